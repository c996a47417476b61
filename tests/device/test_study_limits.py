"""A study's rig gives the driver its limits, and no place lies beyond the beam."""

from device.beam.beam import Beam
from device.drivers.limits import Amplifier, Limits
from device.study_limits import device_limits, reach_problems
from protocol.study.rig_settings import Rig
from protocol.study.study import Study
from tests.protocol.studies import small_document

END_M = Beam().length_m


def test_each_limit_of_the_rig_is_the_drivers() -> None:
    rig = Rig(
        max_voltage_v=110,
        max_frequency_hz=31_000,
        ramp_v_per_s=210,
        watchdog_s=0.75,
        max_temperature_c=61,
        amplifier_gain=20,
        generator_max_vpp=9,
        max_slew_v_per_us=19,
        max_current_ma=64,
        capacitance_nf=32,
    )
    assert device_limits(rig) == Limits(
        max_voltage_v=110,
        max_frequency_hz=31_000,
        ramp_v_per_s=210,
        watchdog_s=0.75,
        max_temperature_c=61,
        amplifier=Amplifier(
            gain=20,
            max_vpp=9,
            max_slew_v_per_us=19,
            max_current_a=1e-3 * 64,
            load_f=1e-9 * 32,
        ),
    )


def test_what_the_study_does_not_say_is_not_limited() -> None:
    limits = device_limits(Rig())
    assert limits.max_temperature_c is None
    assert limits.amplifier == Amplifier(max_vpp=10, max_slew_v_per_us=40)


def touching(**places: object) -> Study:
    document = small_document()
    document["touch"] |= places
    return Study.model_validate(document)


def test_the_end_of_the_beam_can_be_touched() -> None:
    study = touching(path_m=[0.01, END_M], smooth_place_m=END_M)
    assert list(reach_problems(study)) == []


def test_each_place_beyond_the_end_of_the_beam_is_named() -> None:
    beyond_m = END_M + 0.0011
    first, second, third = reach_problems(
        touching(path_m=[beyond_m, END_M + 0.01], smooth_place_m=END_M + 0.02)
    )
    assert [first.path, second.path, third.path] == [
        ("touch", "path_m", 0),
        ("touch", "path_m", 1),
        ("touch", "smooth_place_m"),
    ]
    assert str(first.where) == "touch.path_m.0"
    assert f"{1e3 * beyond_m:.12g} mm; the beam is {1e3 * END_M:g} mm long" in first.hint


def test_each_end_of_a_slide_beyond_the_beam_is_named_if_slides_are_asked_for() -> None:
    document = small_document()
    whole, beyond = [0.01, END_M], [0.01, END_M + 0.01]
    document["slide"] = {"paths_m": [whole, beyond]}
    study = Study.model_validate(document)
    (problem,) = reach_problems(study)
    assert problem.path == ("slide", "paths_m", 1, 1)
    asked_for = study.model_fields_set - {"slide"}
    nobody_slides = Study.model_construct(asked_for, **dict(study))
    assert list(reach_problems(nobody_slides)) == []


def moving(standard_m: float, *places_m: float) -> Study:
    """Return a study with a track of places; a track before it never leaves the beam."""
    hold = {"place": "smooth", "voltage_v": 100}
    track = {"task": "two intervals", "method": "constant", "trials": 10, "comparison": hold}
    volts = {"name": "volts", "axis": "voltage", "comparison": {"place": "smooth"}}
    volts["levels"] = {"values": [50, 100]}
    places = {"name": "places", "axis": "place", "levels": {"values": list(places_m)}}
    places["standard"] = {**hold, "place_m": standard_m}
    return Study.model_validate(small_document() | {"track": [track | volts, track | places]})


def test_a_track_may_move_to_the_end_of_the_beam() -> None:
    assert list(reach_problems(moving(END_M, 0.01, 0.05))) == []
    assert list(reach_problems(moving(0.01, 0.05, END_M))) == []
    assert list(reach_problems(moving(0.01))) == [], "its levels are refused elsewhere"


def test_levels_and_standard_of_a_track_beyond_the_end_are_named() -> None:
    levels, standard = reach_problems(moving(END_M + 0.02, 0.05, END_M + 0.01))
    assert [levels.path, standard.path] == [("track", 1, "levels"), ("track", 1, "standard")]
    assert [levels.where, standard.where] == ["track places, levels", "track places, standard"]
    assert [levels.value, standard.value] == [f"{END_M + 0.01!r} m", f"{END_M + 0.02!r} m"]
