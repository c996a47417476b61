"""What an author should know of a surface: each warning on a study that earns it, else none."""

import pytest

from device.friction.calibration import Calibration
from device.friction.surface_checks import surface_warnings, table_problems
from device.friction.surfaces import MeasuredSurface, beam_surface, friction_table
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template, with_digests
from tests.protocol.surfaces import (
    ALUMINIUM,
    ALUMINIUM_HZ,
    MEASURED,
    friction_csv,
    paper_on,
    study_files,
)

MOUNTED = ("nominal_resonance_hz = 24221", f"nominal_resonance_hz = {ALUMINIUM_HZ:.0f}")


def of_beam(surface: str, *changes: tuple[str, str]) -> list[str]:
    study = parsed_study(paper_on(surface, *changes))
    return list(surface_warnings(study, beam_surface(study.surface)))


def of_table(rows: str, text: str | None = None) -> tuple[Study, MeasuredSurface]:
    whole = with_digests(text or paper_on(MEASURED), "tables", {"friction.csv": "0" * 64})
    cells = [row.split(",") for row in rows.splitlines()]
    table = friction_table(cells, "friction.csv", "0" * 64)
    return parsed_study(whole), MeasuredSurface(length_m=0.12, table=table)


def test_the_templates_and_a_sound_beam_earn_none() -> None:
    for name in ("paper", "extended", "threshold"):
        study = parsed_study(template(name))
        assert list(surface_warnings(study, Calibration().surface)) == []
    assert of_beam(ALUMINIUM, MOUNTED) == []
    assert "Surface" not in str(study_files("beam")["study.toml"])


@pytest.mark.parametrize(
    ("surface", "hz", "said"),
    [
        (
            ALUMINIUM,
            24_221,
            "resonance_hz, 24221 Hz, is mode 7 at 25417 Hz, not mode 6 at 19394 Hz.",
        ),
        (
            ALUMINIUM.replace("thickness_m = 0.003", "thickness_m = 0.0001"),
            24_221,
            "24221 Hz, lies far beyond mode 6 at 684 Hz, and beyond mode 24.",
        ),
        (
            ALUMINIUM.replace("centre_m = 0.072", "centre_m = 0.060"),
            19_315,
            "Mode 6 has 0 % of the motion at its resonance: the patches drive other modes, too. "
            "One of them would drive it most at 88.0 mm.",
        ),
        (
            ALUMINIUM.replace("thickness_m = 0.003", "thickness_m = 0.008").replace("= 6", "= 8"),
            63_164,
            "Half a wave, 14.1 mm, is shorter than 3 thicknesses of the beam",
        ),
        (
            ALUMINIUM.replace("width_m = 0.01\n", "width_m = 0.03\n", 1),
            19_353,
            "the beam is wide, 30.0 mm: it moves as a plate, and its zones cannot be trusted.",
        ),
        (
            ALUMINIUM.replace("mode = 6", "mode = 12").replace(
                "width_m = 0.01\n", "width_m = 0.006\n"
            ),
            64_700,
            "the contact, 10.0 mm, which so covers zones of both directions.",
        ),
    ],
)
def test_a_beam_earns_its_warning_and_no_other(surface: str, hz: int, said: str) -> None:
    rig = (
        (MOUNTED[0], f"nominal_resonance_hz = {hz}"),
        ("max_frequency_hz = 40000", "max_frequency_hz = 100000"),
        ("max_slew_v_per_us = 40", "max_slew_v_per_us = 200"),
    )
    (warning,) = of_beam(surface, *rig)
    assert said in warning


def test_a_table_that_is_coarse_or_lacks_what_changes_earns_warnings() -> None:
    study, surface = of_table(friction_csv(places=13))
    warnings = list(surface_warnings(study, surface))
    assert warnings[0].startswith("If every second value of place_m were left out, the table's")
    lacking = [it for it in warnings if "has no column" in it]
    assert [it.split("column ")[1].split(",")[0] for it in lacking] == [
        "frequency",
        "force_n",
        "beam",
    ]
    assert "change with it in pressure: measure it" in lacking[1]


def test_a_table_of_another_resonance_earns_a_warning() -> None:
    header, *rows = friction_csv().splitlines()
    told = "\n".join([f"{header},resonance_hz", *(f"{row},30000" for row in rows)])
    study, surface = of_table(told)
    said = (
        "The table was measured at a resonance of 30000 Hz, but rig.nominal_resonance_hz is 24221"
    )
    assert any(said in warning for warning in surface_warnings(study, surface))


@pytest.mark.parametrize(
    ("rows", "where"),
    [
        (friction_csv((0, 50, 100)), "condition voltage, touch 1: must lie within the table"),
        (
            friction_csv((50, 100, 200)),
            "opening 1, touch 1: must lie within the table",
        ),
    ],
)
def test_a_touch_beyond_the_table_is_a_problem(rows: str, where: str) -> None:
    assert any(where in str(problem) for problem in table_problems(*of_table(rows)))


def test_levels_of_a_track_beyond_the_table_are_a_problem() -> None:
    text = template("threshold").replace("[touch]", "[touch]\npath_m = [0.01, 0.1]", 1) + MEASURED
    study, surface = of_table(friction_csv((0, 50, 100)), text)
    problems = [str(problem) for problem in table_problems(study, surface)]
    assert any(it.startswith("track smallest amplitude, level 160") for it in problems)
    assert list(table_problems(*of_table(friction_csv(), text))) == []
