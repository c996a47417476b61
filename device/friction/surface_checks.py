"""What a study may not ask of its surface, and what its author should know of it."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from device.beam.beam import Beam
from device.beam.fields import mode_share
from device.beam.spectral import (
    fine_to_hz,
    natural_frequency_hz,
    spectrum,
    spectrum_with_mode,
)
from device.errors import OutOfRangeError
from device.friction.changes import stated_friction
from device.friction.rungs import LEAST_SHARE
from device.friction.surfaces import (
    AnySurface,
    BeamSurface,
    FrictionTable,
    GivenSurface,
    MeasuredSurface,
    beam_surface,
)
from protocol.errors import Path, Problem, listed
from protocol.plan.orders import scaled
from protocol.study.study import Condition, Study
from protocol.study.study_question import QUESTIONS
from protocol.study.surface import Surface
from protocol.study.touch import Touch


def surface_problems(study: Study) -> Iterator[Problem]:
    """Yield what is impossible: patches off the beam, drives above its cut-off, long contacts."""
    surface = study.surface
    if surface.kind == "beam":
        if wrong := list(_patch_problems(surface)):
            yield from wrong
            return
        try:
            own = beam_surface(surface)
            natural_frequency_hz(own.structure.beam, own.mode)
        except OutOfRangeError as error:
            name = error.name.replace("patch ", "patch.").replace("beam ", "").replace(" ", "_")
            yield Problem.of_key(f"surface.{name}", error.rule, error.value)
            return
        yield from _above_cut_off(study, own.structure.beam)
    length_m = surface.length_m or beam_surface(surface).length_m
    for where, contact_m in (("touch", study.touch.contact_m), ("slide", study.slide.contact_m)):
        if contact_m > length_m and where in study.model_fields_set:
            rule = f"must not be longer than the surface, {length_m:g} m"
            yield Problem.of_key(f"{where}.contact_m", rule, f"{contact_m:g}")


def _patch_problems(surface: Surface) -> Iterator[Problem]:
    """Yield the patches that do not lie on the beam, each by itself."""
    for number, patch in enumerate(surface.patch):
        try:
            beam_surface(surface.model_copy(update={"patch": (patch,)}))
        except OutOfRangeError as error:
            of_patch, _, key = error.name.partition(" ")
            if of_patch == "patch":
                where = f"surface.patch {number + 1}, {key}"
                path = ("surface", "patch", number, key)
                yield Problem.of_key(path, error.rule, error.value, where=where)


def _above_cut_off(study: Study, beam: Beam) -> Iterator[Problem]:
    if not study.surface.is_own_beam:
        return
    peak = max((touch.peak_frequency for touch in _touches(study)), default=1.0)
    highest_hz = peak * study.rig.nominal_resonance_hz
    if highest_hz > beam.cut_off_hz:
        rule = f"must keep every drive below the beam's cut-off, {beam.cut_off_hz:.0f} Hz"
        value = f"{highest_hz:.0f} Hz"
        yield Problem.of_key("rig.nominal_resonance_hz", rule, value)


def _touches(study: Study) -> Iterator[Touch]:
    for item in (*study.opening, *study.condition):
        yield from item.touches


def table_problems(study: Study, surface: AnySurface) -> Iterator[Problem]:
    """Yield the touches beyond what a table of friction holds, which nothing predicts."""
    if not isinstance(surface, MeasuredSurface):
        return
    for where, path, touch in _all_touches(study):
        for name, values in _asked_of(study, touch).items():
            for rule, value in _beyond(surface.table, name, values):
                yield Problem.of_key(path, rule, value, where=where)


def _all_touches(study: Study) -> Iterator[tuple[str, Path, Touch]]:
    """Yield all touches at their largest amplitude, and at rest where change is told from that."""
    for key, items in (("opening", study.opening), ("condition", study.condition)):
        for at, item in enumerate(items):
            largest = max(item.levels) if isinstance(item, Condition) else 1.0
            what = item.name if isinstance(item, Condition) else at + 1
            for number, touch in enumerate(item.touches):
                where, path = f"{key} {what}, touch {number + 1}", (key, at, "touches", number)
                yield where, path, scaled(touch, largest)
                depth = item.question is not None and QUESTIONS[item.question].effect == "depth"
                rated = isinstance(item, Condition) and item.question is None
                if rated or (item.question and (depth or len(item.touches) == 1)):
                    yield f"{where}, at rest", path, scaled(touch, 0.0)
    for at, track in enumerate(study.track):
        if track.standard:
            yield f"track {track.name}, standard", ("track", at, "standard"), track.standard
        # On the axis of contrast levels are searched for among what is predicted.
        for level in () if track.axis == "contrast" else range(len(track.values)):
            where = f"track {track.name}, level {track.values[level]:g}"
            yield where, ("track", at, "levels"), track.at(level, 0.0)


def _asked_of(study: Study, touch: Touch) -> dict[str, tuple[float, ...] | str]:
    """Return by column the numbers or the word for which a touch asks a table of friction."""
    finger = study.touch
    places_m = finger.path_m if touch.place == "path" else (finger.smooth_place_m,)
    if touch.own_place_m is not None:
        places_m = (touch.own_place_m,)
    return {
        "voltage_v": (touch.voltage_v, touch.end_voltage_v),
        "frequency": (touch.frequency, touch.end_frequency),
        "place_m": places_m,
        "direction": touch.direction,
        "force_n": (finger.force_n * touch.press,),
        "speed_m_s": (touch.sliding_speed_m_s or finger.sliding_speed_m_s,),
        "beam": touch.beam or finger.beam or "",
    }


def _beyond(
    table: FrictionTable, name: str, values: tuple[float, ...] | str
) -> Iterator[tuple[str, str]]:
    """Yield what a column must hold, and what is asked of it."""
    if name not in table.axes:
        return
    knots = table.axes[name]
    if isinstance(values, str):
        if values not in knots:
            known = ", ".join(map(str, knots))
            rule = f"must be in the table of friction, whose column {name} has {known}"
            yield rule, repr(values) if values else "none (touch.beam)"
        return
    for value in dict.fromkeys(values):
        if math.isnan(table.at_knots(name, value)):
            rule = f"must lie within the table of friction, {knots[0]:g} to {knots[-1]:g} of {name}"
            yield rule, f"{value:g}"


class SurfaceFacts(NamedTuple):
    """What a beam's model says of it: resonance of the driven mode, its share, all its modes."""

    resonance_hz: float
    mode: int
    share: float
    modes_hz: tuple[float, ...]


_BEYOND, _FARTHEST = 1.5, 16.0
"""How far beyond the nominal resonance modes are listed, and how far beyond the driven one at most:
about four times as many."""


def beam_facts(surface: BeamSurface, nominal_hz: float) -> SurfaceFacts:
    """Return what the model says of a beam; its modes up to the driven one and beyond `nominal_hz`.

    The nominal resonance is the study's.
    """
    beam, mode = surface.structure.beam, surface.mode
    own_hz = natural_frequency_hz(beam, mode)
    reach_hz = max(own_hz, min(_BEYOND * nominal_hz, _FARTHEST * own_hz)) / beam.frequency_scale
    modes = spectrum(beam, float(fine_to_hz(beam, np.array(reach_hz))))
    below = modes.frequencies_hz[beam.rigid_modes :]
    below = below[: max(mode, int((below <= reach_hz).sum()))]
    return SurfaceFacts(
        resonance_hz=own_hz,
        mode=mode,
        share=mode_share(beam, mode),
        modes_hz=tuple((below * beam.frequency_scale).tolist()),
    )


def best_patch_m(surface: BeamSurface) -> float:
    """Return where a patch of the first one's size would drive the mode most, its middle, m."""
    beam = surface.structure.beam
    patch = beam.patches[0]
    places_m = np.linspace(patch.length_m / 2, beam.length_m - patch.length_m / 2, 201)
    bare = spectrum_with_mode(beam, surface.mode, patched=False)
    parts = bare.elements
    place = beam.rigid_modes + surface.mode - 1
    turned = [
        parts.rotation_at(bare.shapes[:, place], places_m + sign * patch.length_m / 2)
        for sign in (-1, 1)
    ]
    return float(places_m[np.argmax(np.abs(turned[1] - turned[0]))])


def surface_warnings(study: Study, surface: AnySurface) -> Iterator[str]:
    """Yield what the author of a study should know of its surface, a sentence each."""
    if isinstance(surface, MeasuredSurface):
        yield from _coarse_knots(surface)
        yield from _missing_columns(study, surface)
        table_hz, nominal_hz = surface.table.resonance_hz, study.rig.nominal_resonance_hz
        if table_hz and abs(math.log(table_hz / nominal_hz)) > _OFF_RESONANCE:
            yield (
                f"The table was measured at a resonance of {table_hz:g} Hz, but "
                f"rig.nominal_resonance_hz is {nominal_hz:g} Hz."
            )
    elif isinstance(surface, BeamSurface) and study.surface.is_own_beam:
        yield from _modes_beside(study, surface)
        yield from _beyond_the_model(study, surface)
    elif isinstance(surface, GivenSurface) and study.absolute:
        yield from _at_rest(study)


def _at_rest(study: Study) -> Iterator[str]:
    """Yield what is wrong with the friction at 0 V to which ratings are compared."""
    at_rest, driven = stated_friction(study)
    if driven and not at_rest:
        yield (
            "No touch at 0 V states its friction, so that predictions are relative to the mean of "
            "what touches state, and catch trials have none: state it, as [[opening]] of the "
            "template plate does."
        )
    if len(set(at_rest)) > 1:
        told = listed(f"{friction:g}" for friction in dict.fromkeys(at_rest))
        yield (
            f"Touches at 0 V state different frictions, {told}: predictions are relative to their "
            "mean."
        )


def _coarse_knots(surface: MeasuredSurface) -> Iterator[str]:
    for name, error in surface.table.left_out_error().items():
        if error > _COARSE:
            yield (
                f"If every second value of {name} were left out, the table's friction would err by "
                f"up to {100 * math.expm1(error):.0f} %: measure at more, or with less noise."
            )


def _missing_columns(study: Study, surface: MeasuredSurface) -> Iterator[str]:
    """Yield the columns that a table lacks although conditions change what they are of."""
    for name in ("frequency", "force_n", "speed_m_s", "direction", "beam", "voltage_v"):
        if name in surface.table.axes:
            continue
        changed = [
            condition.name
            for condition in study.condition
            if len({_asked_of(study, touch)[name] for touch in condition.touches}) > 1
        ]
        if changed:
            yield (
                f"The table of friction has no column {name}, so that nothing is predicted to "
                f"change with it in {', '.join(changed)}: measure it, or do not take a change of 0 "
                "there as known."
            )


def _modes_beside(study: Study, surface: BeamSurface) -> Iterator[str]:
    nominal_hz = study.rig.nominal_resonance_hz
    facts = beam_facts(surface, nominal_hz)
    if nominal_hz > facts.modes_hz[-1] and nominal_hz > _FARTHEST * facts.resonance_hz:
        yield (
            f"rig.nominal_resonance_hz, {nominal_hz:.0f} Hz, lies far beyond mode {facts.mode} at "
            f"{facts.resonance_hz:.0f} Hz, and beyond mode {len(facts.modes_hz)}."
        )
        return
    nearest = min(range(len(facts.modes_hz)), key=lambda at: abs(facts.modes_hz[at] - nominal_hz))
    if nearest + 1 != facts.mode:
        yield (
            f"The nearest mode to rig.nominal_resonance_hz, {nominal_hz:.0f} Hz, is mode "
            f"{nearest + 1} at {facts.modes_hz[nearest]:.0f} Hz, not mode {facts.mode} at "
            f"{facts.resonance_hz:.0f} Hz."
        )
    if facts.share < LEAST_SHARE:
        yield (
            f"Mode {facts.mode} has {100 * facts.share:.0f} % of the motion at its resonance: the "
            "patches drive other modes, too. One of them would drive it most at "
            f"{1e3 * best_patch_m(surface):.1f} mm."
        )


def _beyond_the_model(study: Study, surface: BeamSurface) -> Iterator[str]:
    beam, contact_m = surface.structure.beam, study.touch.contact_m
    half_m = surface.half_wave_m
    half = f"Half a wave, {1e3 * half_m:.1f} mm, is shorter than"
    if half_m < _THICKNESSES * beam.thickness_m:
        yield f"{half} {_THICKNESSES} thicknesses of the beam, for which its model is not made."
    if half_m < beam.width_m:
        yield (
            f"{half} the beam is wide, {1e3 * beam.width_m:.1f} mm: it moves as a plate, and its "
            "zones cannot be trusted."
        )
    if contact_m > half_m:
        yield (
            f"{half} the contact, {1e3 * contact_m:.1f} mm, which so covers zones of both "
            "directions."
        )


_COARSE = 0.05
_OFF_RESONANCE = 0.1
"""As ln: rigs differ by a few per cent."""
_THICKNESSES = 3
