"""The report of a study with factors, and of one with several sessions."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import rankdata, ttest_rel

from analysis.cells import json_text
from analysis.loading.study_data import load_study_data
from analysis.report.drawing import labels_of, marked
from analysis.report.hypotheses import how_tested, registered
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.results import DIFFER, TOGETHER, WHICH, paragraphs
from analysis.statistics.factorial import Factorial
from protocol.registration.registration import effect_of
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study
from tests.analysis.chains import asked_session, chain
from tests.analysis.report.test_report import nulls_without_reason
from tests.analysis.reports import ORIGIN, PAPER, plain_report

FACTORS = """
[study]
name = "ramps"
[design]
order = "blocks"
[rating]
score_when = "always"
[[factor]]
name = "voltage"
varies = "ramp_to_v"
values = VOLTAGES
[[factor]]
name = "direction"
varies = "direction"
values = ["left", "right"]
[[condition]]
name = "ramp"
question = "roughness"
expected = "smoother"
touches = [{ place = "path", voltage_v = 0 }]
"""


def study_of(*voltages: int) -> Study:
    return parsed_study(FACTORS.replace("VOLTAGES", str(list(voltages))))


def sessions_of(study: Study, people: int, sessions: int = 1, unnoticed: float = 0.0) -> Report:
    """A report in which ratings rise with the condition's place in the file.

    A share of the changes is `unnoticed`, and answered as none.
    """
    rng = np.random.default_rng(5)
    chains = []
    for person in range(people):
        for session in range(1, sessions + 1):
            scores = np.clip(
                np.round(rng.normal(np.linspace(2, 8, len(study.conditions)), 1)), 0, 10
            )
            told = [
                (name, "same", None) if rng.random() < unnoticed else (name, "smoother", int(score))
                for name, score in zip(study.conditions, scores, strict=True)
            ]
            events = asked_session(f"P{person:02d}", told, study.conditions, session=session)
            chains.append(chain(events))
    found, origin = load_study_data(chains, rehearsals=False), replace(ORIGIN, alone=True)
    return report("ramps", found, study, origin, shown=("factors",))


@cache
def crossed_report() -> Report:
    return sessions_of(study_of(50, 100, 200), 8, sessions=2, unnoticed=0.1)


def test_effects_levels_and_figures_of_each_factor_and_of_the_session() -> None:
    made = crossed_report()
    data = report_json(made)["factors"]
    named = ["voltage", "direction", "session"]
    pairs = [["voltage", "direction"], ["voltage", "session"], ["direction", "session"]]
    assert [it["factors"] for it in data["effects"]] == [[name] for name in named] + pairs
    assert data["effects"][0]["p_holm"] < 0.05
    assert [it["level"] for it in data["levels"]][:3] == ["50 V", "100 V", "200 V"]
    assert [it["p_holm"] for it in data["effects"]] == list(made.questions.p_holm.values())[-6:]
    assert data["effects"][0]["people"] == 8, "nobody is left out who noticed nothing"
    assert data.keys() == {"effects", "levels"}
    page = report_html(made)
    assert "Which factors matter?" in page
    assert "Voltage mattered, from M = " in page
    assert "as expected, these scored " in page
    assert "tests within eight participants, main effects on ranks" in page
    for number in (1, 2, 3):
        assert f'id="figure-factor-{number}"' in page
    assert 'id="figure-factor-4"' not in page


def test_effects_and_levels_are_those_of_the_trials() -> None:
    """Means by hand from the trials, and F of each person's ranks by scipy."""
    made = crossed_report()
    numbers = report_json(made)
    of = {
        name: dict(zip(("voltage", "direction"), name.split(", "), strict=True))
        for name in made.study.conditions
    }
    people = made.loaded.table.subjects
    responses = {
        (row["subject"], row["condition"], row["session"]): row["response"]
        for row in made.trial_records
    }
    assert set(responses.values()) >= {0.0}
    trials = [row | of[row["condition"]] for row in made.trial_records]
    for told in numbers["factors"]["levels"]:
        name = told["factor"]
        own = [row for row in trials if str(row[name]) == told["level"]]
        assert told["mean"] == pytest.approx(np.mean([row["response"] for row in own]))
        expected = [row for row in own if row["agrees"]]
        assert told["expected"] == pytest.approx(len(expected) / len(own))
        assert told["score"] == pytest.approx(np.mean([row["score"] for row in expected]))
    means = np.array(
        [
            [np.mean([responses[who, name, at] for at in (1, 2)]) for name in made.study.conditions]
            for who in people
        ]
    )
    ranks = np.array([rankdata(own) for own in means])
    names = np.array([of[name]["direction"] for name in made.study.conditions])
    sides = [
        ranks[:, names == level].mean(axis=1) for level in ("direction left", "direction right")
    ]
    paired = ttest_rel(*sides)
    effect = next(it for it in numbers["factors"]["effects"] if it["factors"] == ["direction"])
    assert effect["f"] == pytest.approx(paired.statistic**2)
    assert effect["p_f"] == pytest.approx(paired.pvalue)


def test_an_effect_that_is_the_same_in_everybody_has_no_f_and_says_so() -> None:
    study = study_of(50, 100, 200)
    told = [(name, "smoother", place) for place, name in enumerate(study.conditions)]
    chains = [chain(asked_session(f"P{who}", told, study.conditions)) for who in range(7)]
    found, origin = load_study_data(chains, rehearsals=False), replace(ORIGIN, alone=True)
    made = report("ramps", found, study, origin, shown=("factors",))
    effect, *_ = report_json(made)["factors"]["effects"]
    assert (effect["f"], effect["p_f"], effect["epsilon"]) == (None, None, None)
    assert effect["f_reason"] == effect["p_f_reason"] == "everybody differs alike"
    assert effect["p"] == effect["p_permuted"] < 0.001
    lost = nulls_without_reason(report_json(made)["factors"])
    assert set(lost) == {".effects.monte_carlo"}, "none where all arrangements were listed"
    assert "scored 4.50), everybody alike, p < .001, partial η² = 1.00." in dict(paragraphs(made))[
        "Which factors matter?"
    ].replace("\N{NO-BREAK SPACE}", " ")


def test_what_rests_on_a_question_counts_only_where_that_holds() -> None:
    found = crossed_report()
    questions, told = found.questions, dict(paragraphs(found))
    matter = "Which factors matter?"
    claims = {DIFFER: "Responses differed between", WHICH: "was above", matter: "mattered"}
    assert all(claim in told[question] for question, claim in claims.items())
    assert told[TOGETHER].startswith("Conditions differ (p")
    # The same with a correction that leaves nothing.
    weak, effects = replace(found), found.factors.effects if found.factors else ()
    vars(weak)["questions"] = replace(
        questions,
        p_holm=dict.fromkeys(questions.p_holm, 0.2),
        factors=Factorial(effects=tuple(replace(it, p_holm=0.2) for it in effects), levels=()),
    )
    told = dict(paragraphs(weak))
    assert not any(claim in told[question] for question, claim in claims.items())
    assert ".200 corrected" in told[DIFFER]
    assert told[TOGETHER].startswith("None of seven questions holds")
    assert "(smallest p: " in told[matter]
    assert "corrected), which does not show that there is none." in told[matter]


def test_a_study_without_factors_has_nothing_of_it() -> None:
    made = plain_report()
    assert made.trials.factorial is None
    assert "factors" not in report_json(made)
    assert "Which factors matter?" not in report_html(made)


def test_sessions_alone_are_crossed_with_the_conditions() -> None:
    made = sessions_of(PAPER, 4, sessions=2)
    effects = made.trials.factorial
    assert effects is not None
    assert [it.name for it in effects.effects] == ["session", "condition × session"]


def test_registered_effects_are_judged_by_their_own_p() -> None:
    made, study = crossed_report(), study_of(50, 100, 200)
    known = how_tested(study)
    assert {"effect of voltage", "voltage by direction", "direction by voltage"} <= known.keys()
    assert not any("session" in name for name in known)  # this study plans a single one
    tests = made.trials.factorial
    assert tests is not None
    for factors in (("voltage",), ("direction", "voltage")):
        found = tests.of(*factors)
        assert found is not None
        told, p, supported = _judged(made, effect_of(*factors))
        assert p == getattr(found.effect, "p", None)
        assert supported == (p is not None and p < 0.05)
        assert "p" in told


def _judged(made: Report, name: str) -> tuple[str, float | None, bool | None]:
    (hypothesis,) = registered(made.study, [name])
    found = hypothesis.judge(made)
    assert isinstance(found, tuple)
    return found


@pytest.mark.parametrize(
    ("voltages", "turned"), [(range(50, 100, 10), False), (range(50, 190, 10), True)]
)
def test_a_table_of_more_conditions_than_people_turns(voltages: range, turned: bool) -> None:
    made = sessions_of(study_of(*voltages), 5)
    table = made.sections[0].blocks[0]
    shape = (len(table.columns), len(table.rows))  # type: ignore[union-attr]
    wide = (len(made.study.conditions) + 2, 6)
    assert shape == ((7, 2 * len(voltages) + 1) if turned else wide)
    text = json.loads(json_text(report_json(made)))["table4"]
    assert text["columns"] == list(made.study.conditions)


def test_names_and_markers_of_thirty_conditions_differ() -> None:
    names = tuple(f"a name that begins alike, {number}" for number in range(30))
    assert len(set(labels_of(names, "condition"))) == 30
    assert labels_of(("short", "a name that is too long"), "condition")[1] == "a name that is …"
    markers = {(each["marker"], each["fillstyle"]) for each in map(marked, range(30))}
    assert len(markers) == 30
