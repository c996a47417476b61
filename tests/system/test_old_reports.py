"""Studies of version 1, reported as version 1 reported them, but for differences that are named.

`reported_by_1.0.0.json` has what matters of the reports that version 1 made of the studies kept in
tests/data: one imported of a data set, one registered with each kind of hypothesis, one with scores
that were not asked for, repeats, groups and factors, one on a rig that a sliding experiment
calibrated, and one with tracks.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import touchbeam
from tests.old_studies import DATA, old_study
from tests.runner.command_line import typed

REHEARSED = {"imported_study"}
SCORES_MISSING = {"imported_study", "withheld_study", "slide_study", "track_study"}


class Difference(NamedTuple):
    """A number that differs, as it was and is, and why."""

    key: str
    before: Any
    after: Any
    why: str


EVERY_TRIAL = "tests compare responses of every trial, where scores were compared before"
NO_TEST = "the test of an effect on scores of complete people has left"
NO_MANDEL = "Mandel's test of people's slopes on the conditions' effects has left"
NO_GAIN = "the test of the group's gain in the model of scores alone has left with that model"
ONE_POSTERIOR = "a threshold is of one posterior with its curve, in which answers scatter"
UNPROTECTED = "its primary hypothesis is not tested, so that it is judged by its own p"
DIFFERENCES = {
    "imported_study": [
        Difference("omnibus", ["skillings_mack", 1.0], ["friedman", 0.4], EVERY_TRIAL),
        Difference("frequency - structure", None, 1.0, EVERY_TRIAL),
        Difference("structure - voltage", None, 1.0, EVERY_TRIAL),
        Difference("structure - direction", None, 1.0, EVERY_TRIAL),
        Difference("structure - pressure", None, 1.0, EVERY_TRIAL),
        Difference("order of printed", [-0.410391341, 0.5], [-0.666885929, 4 / 15], EVERY_TRIAL),
        Difference("order of consistent", [0.1, 0.95], [0.7, 0.233333333], EVERY_TRIAL),
        Difference("order of coulomb", [0.3, 0.683333333], [0.9, 0.0833333333], EVERY_TRIAL),
        Difference("order of paper's ranking", [0.670820393, 0.3], [0.894427191, 0.1], EVERY_TRIAL),
    ],
    "registered_study": [
        Difference("effect of voltage by frequency", None, 0.25, EVERY_TRIAL),
        Difference("threshold of A01 in rising", 70.3504576, 72.5143717, ONE_POSTERIOR),
        Difference("threshold of B01 in rising", 70.3504576, 72.5143717, ONE_POSTERIOR),
        Difference("threshold of A02 in rising", 46.9028329, 38.2517959, ONE_POSTERIOR),
        Difference("threshold of A01 in falling", 48.8901484, 40.5466969, ONE_POSTERIOR),
        Difference("threshold of B01 in falling", 48.8901484, 40.5466969, ONE_POSTERIOR),
        Difference("threshold of A02 in falling", 54.5427517, 54.4364239, ONE_POSTERIOR),
        Difference(
            "registered: Weber fraction of rising below 0.15",
            [True, None],
            [False, None],
            ONE_POSTERIOR,
        ),
        Difference("registered: effect of voltage", [False, 0.25], [None, None], NO_TEST),
        Difference("registered: gains differ", [False, 0.4449], [None, None], NO_MANDEL),
    ],
    "withheld_study": [
        Difference(
            "omnibus", ["skillings_mack", 0.0129798702], ["friedman", 0.234549817], EVERY_TRIAL
        ),
        Difference("order of printed", [-0.4, 0.75], [-0.210818511, 0.833333333], EVERY_TRIAL),
        Difference("order of consistent", [0.4, 0.75], [0.210818511, 0.833333333], EVERY_TRIAL),
        Difference("order of coulomb", [0.4, 0.75], [0.210818511, 0.833333333], EVERY_TRIAL),
        Difference("groups", 0.2, 0.4, EVERY_TRIAL),
        Difference("effect of voltage", 0.5, 0.125, EVERY_TRIAL),
        Difference("effect of frequency", 0.5, 1.0, EVERY_TRIAL),
        Difference("effect of voltage by frequency", 1.0, 0.875, EVERY_TRIAL),
        Difference("registered: effect of voltage", [False, 0.5], [None, None], NO_TEST),
        Difference("registered: voltage by frequency", [False, 1.0], [None, None], NO_TEST),
        Difference("registered: gains differ", [False, 0.0841], [None, None], NO_MANDEL),
        Difference(
            "registered: ratings follow the prediction", [False, None], [None, None], NO_GAIN
        ),
        Difference(
            "registered: conditions differ",
            [False, 0.0129798702],
            [True, 0.0129798702],
            UNPROTECTED,
        ),
    ],
    "track_study": [
        Difference("omnibus", ["skillings_mack", None], ["friedman", None], EVERY_TRIAL),
        Difference("threshold of P01 in smallest amplitude", 41.0544616, 38.559026, ONE_POSTERIOR),
        Difference("threshold of P02 in smallest amplitude", 51.6998294, 48.7209632, ONE_POSTERIOR),
        Difference("threshold of P01 in by a staircase", 37.2253513, 26.3642427, ONE_POSTERIOR),
        Difference("threshold of P02 in by a staircase", 38.8676848, 29.5739933, ONE_POSTERIOR),
    ],
    "slide_study": [
        Difference(
            "omnibus", ["skillings_mack", 0.095399046], ["friedman", 0.362777778], EVERY_TRIAL
        ),
        Difference(
            "order of printed", [-0.666885929, 4 / 15], [-0.461690258, 0.433333333], EVERY_TRIAL
        ),
        Difference("order of consistent", [-0.3, 0.683333333], [-0.4, 0.516666667], EVERY_TRIAL),
        Difference("order of coulomb", [0.1, 0.95], [-0.2, 0.783333333], EVERY_TRIAL),
        Difference("order of paper's ranking", [0.447213595, 0.6], [0.223606798, 1.0], EVERY_TRIAL),
    ],
}
NOW = touchbeam.__version__
OTHER_VERSION = f"version: reported by touchbeam {NOW}, not 1.0.0"
NO_READINGS = (
    "analysis: withheld scores: missing; registered: missing; beside it read as zero and as the "
    "lowest score"
)
WITHOUT_TEST = (
    *("effect of voltage", "voltage by frequency"),
    *("gains differ", "ratings follow the prediction"),
)
OTHER_MODEL = (
    "analysis: sensitivity model: noticing (probit), then rating (ordinal mixed model) with a "
    "column for who noticed, integrated over their variances; registered: M2, ordinal mixed model, "
    "integrated over its variances"
)
UNTESTED = [
    f"hypothesis: {name}: not tested, as touchbeam {NOW} does not have its test"
    for name in WITHOUT_TEST
]
LEFT = {"gains differ": NO_MANDEL}
"""Numbers that no report has any more, and why."""
DEVIATIONS = {
    "imported_study": [OTHER_VERSION, OTHER_MODEL, NO_READINGS],
    "registered_study": [OTHER_VERSION, *UNTESTED, OTHER_MODEL, NO_READINGS],
    "withheld_study": [OTHER_VERSION, *UNTESTED, OTHER_MODEL, NO_READINGS],
    "slide_study": [OTHER_VERSION, UNTESTED[-1], OTHER_MODEL, NO_READINGS],
    "track_study": [],
}
"""What was not there before: registrations are of version 1; M2 and readings of scores have
left.
"""


def numbers(told: Mapping[str, Any]) -> dict[str, Any]:
    """Return by name what matters of a report; tests on scores stand apart where there are such."""
    found: dict[str, Any] = {
        f"mean of {name}": mean for name, mean in told["table4"]["column_means"].items()
    }
    found |= {"grand mean": told["table4"]["grand_mean"]}
    found |= {"left out": [f"{it['participant']}: {it['why']}" for it in told["exclusions"]]}
    for of, tests in (("", told), (" of scores", told.get("scores", told))):
        if tests is None:
            continue
        name = "friedman" if tests["skillings_mack"] is None else "skillings_mack"
        test = tests[name]
        found[f"omnibus{of}"] = [name, test.get("p_exact", test.get("p_monte_carlo"))]
        found |= {f"{it['a']} - {it['b']}{of}": it["p_holm"] for it in tests["pairwise"]}
    for law in told["laws"]:
        found[f"order of {law['law']}"] = [law["spearman"], law["p"]]
    found["groups"] = told.get("groups", {}).get("score", {}).get("p")
    for effect in told.get("factors", {}).get("effects", ()):
        found[f"effect of {' by '.join(effect['factors'])}"] = effect.get("p")
    for each in told.get("detection", {}).get("conditions", ()):
        found[f"noticed {each['condition']}"] = each.get("p_holm")
    for each in told.get("thresholds", {}).get("people", ()):
        found[f"threshold of {each['participant']} in {each['track']}"] = each.get("threshold")
    settled = told.get("registration", {"results": [], "deviations": []})
    for each in settled["results"]:
        found[f"registered: {each['name']}"] = [each["supported"], each["p"]]
    found["deviations"] = [f"{it['kind']}: {it['text']}" for it in settled["deviations"]]
    return found


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal, numbers to six digits."""
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return one == pytest.approx(other, rel=1e-6, abs=1e-9)
    return bool(one == other)


@pytest.mark.parametrize("name", DIFFERENCES)
def test_an_old_study_is_reported_as_before_but_for_what_is_named(
    name: str, tmp_path: Path
) -> None:
    kept = json.loads((DATA / "reported_by_1.0.0.json").read_text(encoding="utf-8"))[name]
    study = old_study(name, tmp_path / name)
    assert typed("report", study, *["--rehearsals"] * (name in REHEARSED)) == 0
    told = json.loads((study / "report" / "report.json").read_text(encoding="utf-8"))
    assert (told["scores"] is None) == (name in SCORES_MISSING), "only of complete scores"
    before = {key: value for key, value in kept.items() if key not in LEFT}
    after = numbers(told)
    if told["scores"] is None:
        before = {key: value for key, value in before.items() if not key.endswith(" of scores")}
    assert before.keys() == after.keys()
    added = [text for text in after.pop("deviations") if text not in before["deviations"]]
    assert added == DEVIATIONS[name]
    changed = {key: (before[key], now) for key, now in after.items() if not same(before[key], now)}
    expected = {it.key: (it.before, it.after) for it in DIFFERENCES[name]}
    assert changed.keys() == expected.keys()
    for key, pair in expected.items():
        assert same([*changed[key]], [*pair]), key


def test_an_old_study_says_what_it_keeps_of_version_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its rule on exclusions and its tests: on the page, in its data and at the terminal."""
    study = old_study("withheld_study", tmp_path / "study")
    assert typed("report", study) == 0
    said = capsys.readouterr().out
    page = (study / "report" / "report.html").read_text(encoding="utf-8")
    told = json.loads((study / "report" / "report.json").read_text(encoding="utf-8"))
    assert told["left_out_for_not_noticing"] == ["A03"]
    unnoticing = "Left out only because they noticed few changes: A03."
    by_its_tests = "Registered with touchbeam 1.0.0: its tests, of scores, are done as then."
    for text in (unnoticing, "not protected by a primary hypothesis"):
        assert text in said
        assert text in page
    assert by_its_tests in said.splitlines()
    assert "(registered with another test: conditions differ)" in page
    assert "nothing protects the secondary ones" in page
    assert "primary hypothesis is tested alone" not in page
    unprotected = [it["name"] for it in told["registration"]["results"] if not it["protected"]]
    untested = [it["name"] for it in told["registration"]["results"] if not it["tested"]]
    assert untested == [*WITHOUT_TEST]
    for name in untested:
        why = f"registered with touchbeam 1.0.0, whose test of {name} this version does not have"
        assert why in page
    everything = {it["name"] for it in told["registration"]["results"]}
    assert everything == {*unprotected, *untested}
