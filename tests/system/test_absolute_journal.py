"""A stored journal of absolute ratings: four rehearsals, five conditions, rated 1 to 7 at once.

`reported_absolute.json` has the numbers of its report that must not move, as they were when the
journal was kept.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.analysis.export.data_slips import csv_rows
from tests.old_studies import DATA, old_study
from tests.runner.command_line import typed
from tests.system.test_old_reports import numbers

KEPT = json.loads((DATA / "reported_absolute.json").read_text(encoding="utf-8"))
ABOUT = 1e-3
"""Relative: estimates of the model come from an optimizer, tests from whole numbers."""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return old_study("absolute_study", tmp_path / "study")


def settled(told: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a report that must not move, by name."""
    tests = {name: value for name, value in numbers(told).items() if name != "deviations"}
    slope, rating = told["responses"]["slope"], told["rating"]
    return {
        "tests": {
            **tests,
            "slope": [slope["value"], slope["ci"], slope["p"]],
            "questions": told["questions_p_holm"],
            "catch trials": told["table4"]["catch"]["scores"],
            "predicted": [of["predicted"] for of in told["laws"]],
        },
        "model": {
            "group": [rating["group_level"], rating["group_gain"], rating["equal_gains"]],
            **{each["subject"]: [each["level"], each["gain"]] for each in told["sensitivity"]},
        },
    }


def flat(value: Any) -> list[Any]:
    """Return the values of nested lists and mappings, in their order."""
    if isinstance(value, Mapping):
        return [part for name, inner in value.items() for part in (name, *flat(inner))]
    return [part for inner in value for part in flat(inner)] if isinstance(value, list) else [value]


def test_its_numbers_have_not_moved(study: Path) -> None:
    assert typed("report", study, "--rehearsals") == 0
    told = json.loads((study / "report" / "report.json").read_text(encoding="utf-8"))
    for of, relative in {"tests": 1e-6, "model": ABOUT}.items():
        now, kept = flat(settled(told)[of]), flat(KEPT[of])
        assert len(now) == len(kept)
        for one, other in zip(now, kept, strict=True):
            assert one == (pytest.approx(other, relative) if isinstance(other, float) else other)
    page = (study / "report" / "report.html").read_text(encoding="utf-8")
    assert "differed in the touches (amplitudes: 20 V, 40 V, 60 V, 80 V, 100 V)." in page
    assert (told["sensitivity_model"], told["noticing"]["reason"]) == (
        "rating",
        "nobody was asked what changed",
    )


def test_it_is_verified_and_its_scores_are_exported(study: Path, tmp_path: Path) -> None:
    assert typed("verify", study) == 0
    assert typed("export", study, tmp_path / "out", "--format", "csv", "--rehearsals") == 0
    described = json.loads((tmp_path / "out" / "trials.json").read_text(encoding="utf-8"))
    asked = "Asked: “How rough did the plate feel? 1 to 7”."
    assert described["score"]["description"].endswith(asked)
    assert "on another surface" in described["resonance_tip_m_per_v"]["description"]
    rows = csv_rows((tmp_path / "out" / "trials.csv").read_text(encoding="utf-8"))
    scores = [row["score"] for row in rows if row["trial_kind"] in {"trial", "catch"}]
    assert len(scores) == 4 * 11
    assert all(score in {"1", "2", "3", "4", "5", "6", "7"} for score in scores)
