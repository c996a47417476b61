"""Changes under the finger, in a trial or one of the paper's conditions, and their contrasts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np

from device.arrays import FloatArray
from device.friction import scenes
from device.friction.calibration import NOMINAL, Calibration
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import TOP_RUNG, rung_resonance_hz
from device.friction.surfaces import BeamSurface, GivenSurface, MeasuredSurface, beam_surface
from protocol.study.study import Study
from protocol.study.study_question import QUESTIONS, Effect, Question
from protocol.study.touch import Coverage, Direction, Place, Touch, TouchDefaults


@dataclass(frozen=True, kw_only=True)
class Moment:
    """The drive and the touch at one moment; `frequency` is relative to the resonance.

    `has_bodies` says whether the beam carries ciliary bodies; no law here depends on their spacing.
    `beam` is the name of the one that is mounted, on which a table may depend; `friction` what a
    touch states.
    """

    voltage_v: float
    frequency: float
    direction: Direction
    coverage: Coverage
    force_n: float
    contact_m: float
    sliding_speed_m_s: float
    has_bodies: bool
    beam: str | None = None
    friction: float | None = None


Kind = Literal["at a place", "over a path", "growth of a swing"]


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change from one moment to another, felt at `places_m` (right edges of the finger, m).

    - `friction`: mean of `ln(mu_before / mu_after)`;
    - `level`: mean of `ln(mu_after / mu_before)`, before being the same touch at 0 V;
    - `depth`: growth of the modulation depth `rms ln(mu(x) / mu)`;
    - `places`: `rms ln(mu_after(x) / mu_before(x))`.

    `contrary` reverses the sign: the opposite change is the expected one.
    """

    effect: Effect
    contrary: bool
    before: Moment
    after: Moment
    places_m: tuple[float, ...]

    @property
    def kind(self) -> Kind:
        """The kind of the contrast; contrasts of different kinds need not feel alike."""
        if self.effect == "depth":
            return "growth of a swing"
        return "at a place" if len(self.places_m) == 1 else "over a path"


_PLACES = 143
"""Along the path: every half millimetre of the paper's."""
_PER_HALF_WAVE = 36
"""The same on another beam."""


def trial_change(
    study: Study, question: Question | None, expected: str | None, touches: Sequence[Touch]
) -> Change:
    """Return the change from a trial's first touch to the end of its last one.

    Of a single touch it is that during it or, if the drive is constant, from the resting beam. The
    study gives the finger's place, path, force, contact and speed, and the beams.

    Without a question what is felt is rated, not a change of it: the effect is `level`, from the
    last touch at 0 V to its end.
    """
    if question is None:
        return _level(study, touches[-1])
    first, last = touches[0], touches[-1]
    if len(touches) == 1 and first.programme == "hold":
        first = first.model_copy(update={"voltage_v": 0.0, "friction": None})
    effect = QUESTIONS[question].effect
    if effect == "depth" and last.place != "path":
        effect = "friction"
    return Change(
        effect=effect,
        contrary=expected is not None and expected == QUESTIONS[question].less,
        before=_moment(study, first, first.voltage_v, first.frequency),
        after=_moment(study, last, last.end_voltage_v, last.end_frequency),
        places_m=_places_m(study, effect, last.place),
    )


class StatedFriction(NamedTuple):
    """The frictions that a study's touches state, in the order of the file."""

    at_rest: tuple[float, ...]
    driven: tuple[float, ...]


def stated_friction(study: Study) -> StatedFriction:
    """Return what touches at 0 V state, and what the others do."""
    stated = [
        (each.friction, each.peak_voltage_v)
        for item in (*study.condition, *study.opening)
        for each in item.touches
        if each.friction is not None
    ]
    return StatedFriction(
        at_rest=tuple(friction for friction, peak_v in stated if not peak_v),
        driven=tuple(friction for friction, peak_v in stated if peak_v),
    )


def _level(study: Study, touch: Touch) -> Change:
    """Return what a rating of `touch` follows.

    On a stated surface it starts at the friction that the study's touches at 0 V state, else at the
    mean of what is stated, in logarithms: such a constant changes no slope.
    """
    at_rest, driven = stated_friction(study)
    logs = [math.log(friction) for friction in at_rest or driven]
    mean = math.exp(sum(logs) / len(logs)) if logs else None
    rest = touch.model_copy(update={"voltage_v": 0.0, "friction": mean})
    if touch.friction is None and not touch.peak_voltage_v and at_rest:
        touch = rest
    return Change(
        effect="level",
        contrary=False,
        before=_moment(study, rest, 0.0, touch.end_frequency),
        after=_moment(study, touch, touch.end_voltage_v, touch.end_frequency),
        places_m=_places_m(study, "friction", touch.place),
    )


def friction_difference(
    study: Study, standard: Touch, comparison: Touch, rig: Calibration
) -> float:
    """Return how much smoother `comparison` is than `standard`: the mean of ln(mu / mu')."""
    stated = isinstance(rig.surface, GivenSurface)
    if comparison.own_place_m != standard.own_place_m and not stated:
        # At two places each is compared with the beam at rest, which is alike everywhere.
        rests = (touch.model_copy(update={"voltage_v": 0.0}) for touch in (standard, comparison))
        standard_by, comparison_by = (
            friction_difference(study, rest, touch, rig)
            for rest, touch in zip(rests, (standard, comparison), strict=True)
        )
        return comparison_by - standard_by
    own_m = comparison.own_place_m
    change = Change(
        effect="friction",
        contrary=False,
        before=_moment(study, standard, standard.voltage_v, standard.frequency),
        after=_moment(study, comparison, comparison.voltage_v, comparison.frequency),
        places_m=_places_m(study, "friction", comparison.place) if own_m is None else (own_m,),
    )
    return predicted_contrast(change, rig=rig)


def _places_m(study: Study, effect: Effect, place: Place) -> tuple[float, ...]:
    finger = study.touch
    if effect == "friction" and place == "smooth":
        return (finger.smooth_place_m,)
    left_m, right_m = finger.path_m
    places = _PLACES
    if study.surface.is_own_beam:
        half_wave_m = beam_surface(study.surface).half_wave_m
        places = 1 + max(2, math.ceil(_PER_HALF_WAVE * (right_m - left_m) / half_wave_m))
    return _along(left_m, right_m, places)


def _along(left_m: float, right_m: float, places: int) -> tuple[float, ...]:
    step_m = (right_m - left_m) / (places - 1)
    return tuple(left_m + number * step_m for number in range(places))


def _moment(study: Study, touch: Touch, voltage_v: float, frequency: float) -> Moment:
    beam = touch.beam or study.touch.beam
    return Moment(
        voltage_v=voltage_v,
        frequency=frequency,
        direction=touch.direction,
        coverage=touch.coverage,
        force_n=study.touch.force_n * touch.press,
        contact_m=study.touch.contact_m,
        sliding_speed_m_s=touch.sliding_speed_m_s or study.touch.sliding_speed_m_s,
        has_bodies=beam is None or study.beams[beam] > 0,
        beam=beam,
        friction=touch.friction,
    )


_FINGER = TouchDefaults()
REFERENCE = Moment(
    voltage_v=100.0,
    frequency=1.0,
    direction="right",
    coverage="local",
    force_n=_FINGER.force_n,
    contact_m=_FINGER.contact_m,
    sliding_speed_m_s=scenes.REFERENCE_SPEED_M_S,
    has_bodies=True,
)
"""The moment from which the paper's conditions differ: 100 V at resonance."""


def _condition(effect: Effect, before: Moment = REFERENCE, after: Moment = REFERENCE) -> Change:
    return Change(
        effect=effect,
        contrary=False,
        before=before,
        after=after,
        places_m=(_FINGER.smooth_place_m,)
        if effect == "friction"
        else _along(*_FINGER.path_m, _PLACES),
    )


_OFF = replace(REFERENCE, voltage_v=0.0)
CONDITIONS: Mapping[str, Change] = MappingProxyType(
    {
        "signal": _condition("friction", before=_OFF),
        "frequency": _condition("depth", before=replace(REFERENCE, frequency=0.98)),
        "structure": _condition("friction", before=replace(REFERENCE, has_bodies=False)),
        "voltage": _condition("friction", _OFF, replace(REFERENCE, voltage_v=200.0)),
        "direction": _condition("places", after=replace(REFERENCE, direction="left")),
        "pressure": _condition("friction", after=replace(REFERENCE, force_n=1.5 * _FINGER.force_n)),
    }
)
"""The paper's conditions by name (section 5.2); every session opens with `signal`."""

# The predicted contrast of a change: how much friction changes, as one number.

LAW, RUNG = "consistent", TOP_RUNG
"""Under these a contrast is predicted unless others are named. `consistent` alone has the right
limits, and no rung errs less than the top one, which a few contrasts can afford."""


def predicted_contrast(
    change: Change, law: str = LAW, rung: str = RUNG, rig: Calibration = NOMINAL
) -> float:
    """Return the contrast of `change`, positive when the change is the expected one.

    Nothing is expected of a `level`: it is positive where friction rises.

    `Change` gives the formula of each effect. Drives are relative to the resonance of the rung.
    The contrast is NaN where the law gives no friction above 0, as the printed one may.

    >>> from device.friction.changes import CONDITIONS
    >>> round(predicted_contrast(CONDITIONS["pressure"]), 3)
    0.065
    """
    before, after = (
        friction_at(moment, change.places_m, law, rung, rig)
        for moment in (change.before, change.after)
    )
    if not (min(before.min(), after.min()) > 0):
        return np.nan
    if change.effect == "level":
        return float(np.log(after / before).mean())
    # (10) and (11), mathematics/friction
    if change.effect == "places":
        return _rms(np.log(after / before))
    if change.effect == "depth" and not isinstance(rig.surface, GivenSurface):
        resting = _resting(change, law, rung, rig)
        size = _rms(np.log(after / resting)) - _rms(np.log(before / resting))
    else:
        size = float(np.log(before / after).mean())
    return -size if change.contrary else size


def _resting(change: Change, law: str, rung: str, rig: Calibration) -> FloatArray | float:
    """Return the friction with the drive off."""
    if isinstance(rig.surface, BeamSurface):
        return rig.structure.friction_coefficient
    return friction_at(replace(change.before, voltage_v=0.0), change.places_m, law, rung, rig)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@lru_cache(maxsize=4096)
def friction_at(
    moment: Moment,
    places_m: tuple[float, ...],
    law: str = LAW,
    rung: str = RUNG,
    rig: Calibration = NOMINAL,
) -> FloatArray:
    """Return the friction coefficient of `moment` at each place (right edge, m), shape (n,).

    NaN where a table was not measured or a touch states none; law and rung are for beams.
    """
    surface = rig.surface
    if isinstance(surface, GivenSurface):
        return np.full(len(places_m), np.nan if moment.friction is None else moment.friction)
    if isinstance(surface, MeasuredSurface):
        return surface.table.friction(
            {
                "voltage_v": np.array(rig.gain * moment.voltage_v),
                "frequency": np.array(moment.frequency),
                "place_m": np.array(places_m),
                "direction": moment.direction,
                "force_n": np.array(moment.force_n),
                "speed_m_s": np.array(moment.sliding_speed_m_s),
                "beam": moment.beam or "",
            }
        ) * np.ones(len(places_m))
    structure = rig.structure
    drive = scenes.Drive(voltage_v=rig.gain * moment.voltage_v, mode=rig.mode)
    if moment.frequency != 1:
        resonance_hz = rung_resonance_hz(rung, structure.beam, drive.mode)
        drive = replace(drive, frequency_hz=moment.frequency * resonance_hz)
    scene = scenes.Scene(
        structure=structure if moment.has_bodies else replace(structure, body_height_m=0.0),
        drive=drive,
        touch=scenes.FingerContact(
            x_m=0.0,
            contact_m=moment.contact_m,
            finger_load_n=moment.force_n,
            sliding_speed_m_s=moment.sliding_speed_m_s,
        ),
        coverage=moment.coverage,
        direction=moment.direction,
    )
    return friction_coefficient(scene, law=law, rung=rung, x_m=places_m)
