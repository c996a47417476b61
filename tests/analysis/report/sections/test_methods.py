"""Methods and provenance: what is named was made, and with the parameters that are stated."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from html import unescape
from typing import Any

import numpy as np
import pytest

from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.sections import methods
from analysis.report.wording import count_of
from analysis.statistics import omnibus
from device.friction.calibration import Calibration
from device.friction.changes import CONDITIONS, LAW, predicted_contrast
from device.friction.rungs import TOP_RUNG
from protocol.study.study import Study
from tests.analysis.report.sections.test_factors import crossed_report
from tests.analysis.report.sections.test_groups import of_rise
from tests.analysis.report.test_tracks_alone import made as of_tracks
from tests.analysis.reports import (
    EXTENDED,
    ORIGIN,
    PAPER,
    SCORES,
    cohort,
    made,
    plain_report,
    study_report,
)
from tests.analysis.tracks import BOTH, TRACKS


def test_the_stated_rung_is_the_one_used_for_predictions() -> None:
    numbers = report_json(plain_report())
    stated = re.search(r"\brung ([\w-]+)", numbers["provenance"]["model parameters"])
    assert stated is not None
    trial = next(trial for trial in numbers["trials"] if trial["condition"] == "voltage")
    by_rung = {
        rung: predicted_contrast(CONDITIONS["voltage"], LAW, rung) for rung in ("mode", TOP_RUNG)
    }
    assert trial["predicted"][LAW] == by_rung[stated[1]]
    assert by_rung[TOP_RUNG] != pytest.approx(by_rung["mode"], rel=1e-9)


def test_the_seeds_of_permutations_are_stated() -> None:
    stated = report_json(plain_report())["provenance"]["seeds"]
    assert stated.endswith(f"; permutations {omnibus.SEED}")


def test_a_calibrated_rig_is_used_and_named() -> None:
    own = Calibration(damping_ratio=0.004, gain=1.1, origin="session slide/1")
    found = load_study_data(cohort(EXTENDED, 2), rehearsals=False, rules=EXTENDED.exclusions)
    plain, calibrated = (
        report("a study", found, EXTENDED, origin, shown=("methods",))
        for origin in (replace(ORIGIN, alone=True), replace(ORIGIN, alone=True, rig=own))
    )
    stated = report_json(calibrated)["provenance"]["model parameters"]
    assert "damping ratio 0.004" in stated
    assert "gain of the drive 1.1, rig session slide/1" in stated
    assert f"with the rig as calibrated: {own};" in report_html(calibrated)
    assert "as calibrated" not in report_html(plain)
    for kept, before in zip(calibrated.trials.ranges, plain.trials.ranges, strict=True):
        assert kept.value != before.value
        assert set(kept.by_damping) & {"0.004"}


def test_a_calibration_does_not_apply_to_published_scores() -> None:
    own = replace(ORIGIN, rig=Calibration(damping_ratio=0.004, origin="session slide/1"))
    calibrated = report("a study", plain_report().loaded, PAPER, own)
    assert report_json(calibrated) == report_json(plain_report())


# Methods name what was made with these data, and nothing else.


def has(number: Any) -> bool:
    """Whether a number of report.json, or any within it, is known."""
    if isinstance(number, dict):
        return any(has(value) for name, value in number.items() if not name.endswith("reason"))
    if isinstance(number, list):
        return any(map(has, number))
    return number is not None


def made_of(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of each analysis by the name that Methods give it, null where there is none."""
    responses, checks = numbers.get("responses", {}), numbers.get("checks", {})
    groups = numbers.get("groups", {})
    return {
        "friedman": numbers.get("friedman", {}).get("chi2"),
        "skillings_mack": (numbers.get("skillings_mack") or {}).get("statistic"),
        "pairwise": [pair["p"] for pair in numbers.get("pairwise", ())],
        "slope": responses.get("slope", {}).get("p"),
        "level slope": responses.get("level_slope", {}).get("p"),
        "factors": [it["p"] for it in responses.get("factors", ())],
        "groups": [groups.get(name, {}).get("p") for name in ("score", "gain")],
        "profiles": groups.get("interaction", {}).get("p"),
        "noticed": [it.get("p") for it in numbers.get("detection", {}).get("conditions", ())],
        "questions": [*numbers.get("questions_p_holm", {}).values()][1:],
        "order": checks.get("order", {}).get("p"),
        "carry_over": checks.get("carry_over", {}).get("p"),
        "drift": checks.get("drift", {}).get("p"),
        "noticing": numbers.get("noticing", {}).get("subjects"),
        "rating": numbers.get("sensitivity"),
    }


def unmodelled() -> Report:
    """A published table with conditions whose names no friction model knows."""
    scores = np.random.default_rng(3).integers(0, 11, (6, 4))
    return made(scores.tolist(), names=("warm", "cold", "wet", "dry"))


def of_sessions(study: Study, people: int) -> Report:
    found = load_study_data(cohort(study, people), rehearsals=False, rules=study.exclusions)
    return report("a study", found, study, ORIGIN)


MADE: dict[str, Callable[[], Report]] = {
    "a published table without modelled conditions": unmodelled,
    "a published table with holes": lambda: made([[5, 7, np.nan], *SCORES[1:]]),
    "a published table where nobody differs": lambda: made([[5, 5, 5], [6, 6, 6]]),
    "tracks alone": lambda: of_tracks(TRACKS),
    "tracks and one condition": lambda: of_tracks(BOTH),
    "no catch trials": lambda: of_sessions(PAPER, 4),
    "one participant": lambda: of_sessions(EXTENDED, 1),
    "one participant, one trial a condition": lambda: of_sessions(PAPER, 1),
    "catch trials and levels": study_report,
}
NOT_MADE = {
    "a published table without modelled conditions": {"slope", "noticing", "rating", "order"},
    "a published table with holes": {"friedman", "carry_over", "noticing"},
    "a published table where nobody differs": {"friedman", "pairwise", "rating"},
    "tracks alone": set(made_of({})),
    "tracks and one condition": {"friedman", "pairwise", "slope", "rating", "questions"},
    "no catch trials": {"noticed", "level slope", "factors", "groups", "profiles"},
    "one participant": {"friedman", "level slope"},
    "one participant, one trial a condition": {"friedman", "noticed", "noticing"},
    "catch trials and levels": {"skillings_mack", "factors", "groups"},
}


@pytest.mark.parametrize("study", MADE)
def test_methods_name_the_analyses_that_were_made_and_no_other(study: str) -> None:
    found = MADE[study]()
    numbers = report_json(found)
    told = dict([*methods.tests_in_words(found), *methods.models_in_words(found)])
    known = {name for name, number in made_of(numbers).items() if has(number)}
    assert set(told) == known
    assert not known & NOT_MADE[study]
    page = unescape(report_html(found))
    shown = page.partition(">Methods<")[2].partition("<h3")[0]
    assert all(words in shown for words in told.values())
    is_predicted = any(has(row["predicted"]) for row in numbers["trials"] if row["condition"])
    assert ("Contrasts were predicted" in shown) == (is_predicted and "table4" in numbers)


def test_methods_of_a_study_with_groups_and_factors_name_their_tests() -> None:
    grouped, crossed = of_rise(3), crossed_report()
    for found, names in ((grouped, {"groups", "profiles", "noticed"}), (crossed, {"factors"})):
        assert names <= dict(methods.tests_in_words(found)).keys()
    data = replace(grouped.loaded, groups={"P01": "young", "P03": "young"})
    few = dict(methods.tests_in_words(replace(grouped, loaded=data)))
    assert not {"groups", "profiles"} & few.keys(), "nobody is in the other group"


def test_methods_describe_what_each_participant_did() -> None:
    design = EXTENDED.design
    (said, *_) = methods.section(study_report()).blocks
    assert design.opposite_repeats == 1
    assert (
        "A participant had each condition four times (one time in the opposite order) and "
        "four catch trials at 0 V. " in str(said)
    )
    assert "A participant had" not in str(methods.section(plain_report()).blocks[0])
    crossed = crossed_report()
    names = [
        f"{count_of(len(levels), f'{name} level')}"
        for name, levels in crossed.study.factors.items()
    ]
    assert f"Conditions crossed {' × '.join(names)}." in str(methods.section(crossed).blocks[0])
    groups = str(methods.section(of_rise(3)).blocks[0])
    assert "Groups: young and old." in groups or "Groups: young, old." in groups


def test_methods_of_a_study_of_thresholds_describe_its_tracks() -> None:
    found = of_tracks(TRACKS)
    said = methods.section(found).blocks
    (tracks,) = (str(paragraph) for paragraph in said if "Thresholds were" in str(paragraph))
    for track in found.study.track:
        assert f"“{track.name}” ({track.task}, {track.method}" in tracks
        assert f"at most {count_of(track.trials, 'trial')}" in tracks
    assert not any("Each condition changed" in str(paragraph) for paragraph in said)
