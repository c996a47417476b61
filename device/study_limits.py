"""Limits that link a study to its device: the driver's limits and the end of the beam."""

from collections.abc import Iterator

from device.drivers.limits import Amplifier, Limits
from device.friction.surfaces import length_of
from protocol.errors import Path, Problem, dotted
from protocol.study.rig_settings import Rig
from protocol.study.study import Study


def device_limits(rig: Rig) -> Limits:
    """Return the limits that the driver must never exceed on this rig."""
    return Limits(
        max_voltage_v=rig.max_voltage_v,
        max_frequency_hz=rig.max_frequency_hz,
        ramp_v_per_s=rig.ramp_v_per_s,
        watchdog_s=rig.watchdog_s,
        max_temperature_c=rig.max_temperature_c,
        amplifier=Amplifier(
            gain=rig.amplifier_gain,
            max_vpp=rig.generator_max_vpp,
            max_slew_v_per_us=rig.max_slew_v_per_us,
            max_current_a=None if rig.max_current_ma is None else 1e-3 * rig.max_current_ma,
            # Without a capacitance the current is 0, so that no limit on it applies.
            load_f=1e-9 * (rig.capacitance_nf or 0.0),
        ),
    )


def reach_problems(study: Study) -> Iterator[Problem]:
    """Yield a problem for each place of `study` beyond the end of what is touched."""
    what = "the beam" if study.surface.kind == "beam" else "the surface"
    length_m = length_of(study.surface)
    ways: dict[Path, tuple[float, float]] = {("touch", "path_m"): study.touch.path_m}
    # A study that says nothing of sliding must not fail for the paths of its defaults.
    if "slide" in study.model_fields_set:
        paths_m = enumerate(study.slide.paths_m)
        ways |= {("slide", "paths_m", number): path_m for number, path_m in paths_m}
    places: list[tuple[Path, float]] = [
        ((*path, number), place_m)
        for path, way_m in ways.items()
        for number, place_m in enumerate(way_m)
    ]
    places.append((("touch", "smooth_place_m"), study.touch.smooth_place_m))
    for number, track in enumerate(study.track):
        if track.axis == "place":
            places.append((("track", number, "levels"), max(track.values, default=0.0)))
            places.append((("track", number, "standard"), track.reference))
    for path, place_m in places:
        if place_m > length_m:
            where = dotted(path)
            if path[0] == "track":
                where = f"track {study.track[int(path[1])].name}, {path[2]}"
            rule = f"must lie on {what}, which ends at {length_m:g} m"
            hint = f"that is {1e3 * place_m:.12g} mm; {what} is {1e3 * length_m:g} mm long"
            yield Problem(where, rule, f"{place_m!r} m", hint, path)
