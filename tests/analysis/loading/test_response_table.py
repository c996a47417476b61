"""The response and the direction of every answer that a session can hold, as one table."""

from collections.abc import Iterable
from itertools import product
from typing import Literal

import numpy as np
import pytest

from analysis.loading.response import Directions, mean_responses, responses
from analysis.loading.study_data import KINDS, StudyData, Why, load_study_data
from protocol.journal.events import Event, SessionCompleted, TrialExcluded, TrialStarted
from protocol.journal.records import PlannedTrial
from protocol.study.rules import Rating
from protocol.study.study_question import QUESTIONS, Question
from tests.analysis.chains import answer, chain, opened

CONDITIONS = ("this", "other")
When = Literal["agrees", "noticed", "always"]
Way = Literal["expected", "contrary", "same"]
SCORE, LOWEST = 7, 2
CASES = [
    (when, question, opposite, way)
    for when, question, opposite, way in product(
        ("agrees", "noticed", "always"),
        ("roughness", "places"),
        (False, True),
        ("expected", "contrary", "same"),
    )
    # A question of two answers knows no contrary one, and swapped places swap back alike.
    if question == "roughness" or (way != "contrary" and not opposite)
]


def planned(index: int, condition: str, question: Question, *, opposite: bool) -> PlannedTrial:
    asked = QUESTIONS[question]
    return PlannedTrial.from_json(
        {
            "index": index,
            "kind": "trial",
            "condition": condition,
            "question": question,
            "expected": (asked.less if opposite else asked.more) or asked.more,
            "opposite": opposite,
            "scored": True,
        }
    )


def said(trial: PlannedTrial, way: Way) -> str:
    asked = QUESTIONS[trial.question]  # type: ignore[index]
    answers = {asked.more, asked.less} - {trial.expected, None}
    return {"expected": trial.expected, "same": asked.same, "contrary": next(iter(answers), "")}[
        way
    ] or ""


def score(when: When, way: Way) -> int | None:
    """Return the score that such an answer is asked for."""
    rule = Rating(score_when=when)
    return SCORE if rule.asks_score(agrees=way == "expected", noticed=way != "same") else None


def session(
    who: str,
    when: When,
    trials: Iterable[PlannedTrial],
    ways: Iterable[Way | None],
    *,
    number: int = 1,
    more: Iterable[Event] = (),
) -> list[Event]:
    """A session that answers its trials in these ways, and ends before one of None."""
    plan = list(trials)
    events: list[Event] = [opened(who, CONDITIONS, plan, session=number)]
    for trial, way in zip(plan, ways, strict=True):
        if way is None:
            return [*events, *more]
        given = answer(trial, score(when, way), change=said(trial, way))
        events += [TrialStarted(index=trial.index, kind=trial.kind), given]
    return [*events, SessionCompleted(), *more]


def loaded(*sessions: list[Event]) -> StudyData:
    return load_study_data(map(chain, sessions), rehearsals=False)


def cell(data: StudyData) -> float:
    """Return the mean response of the first subject to the first condition."""
    given = responses(data.trials, LOWEST)
    names = data.table.subjects, data.table.conditions
    return float(mean_responses(data.trials, given, *names).scores[0, 0])


EXPECTED = SCORE - LOWEST + 1.0
RESPONSE = {"expected": EXPECTED, "contrary": 0.0, "same": 0.0}


@pytest.mark.parametrize(("when", "question", "opposite", "way"), CASES)
class TestEveryAnswer:
    def test_has_a_response(self, when: When, question: Question, opposite: bool, way: Way) -> None:
        data = loaded(
            session("P01", when, [planned(0, "this", question, opposite=opposite)], [way])
        )
        assert cell(data) == RESPONSE[way]
        assert data.ways[0, 0] == Directions(**{**dict.fromkeys(RESPONSE, 0), way: 1})
        # Table 4 has what was scored, and a mark of an answer that was not the expected one.
        assert data.table.given[0, 0] == (score(when, way) is not None)
        unnoticed = None if data.table.given[0, 0] else KINDS[Why.SAME].mark
        mark = {"expected": None, "contrary": KINDS[Why.CONTRARY].mark, "same": unnoticed}[way]
        assert data.marks.get((0, 0)) == mark

    def test_is_averaged_with_a_repeat(
        self, when: When, question: Question, opposite: bool, way: Way
    ) -> None:
        trials = [planned(at, "this", question, opposite=opposite and not at) for at in (0, 1)]
        assert cell(loaded(session("P01", when, trials, [way, "expected"]))) == (
            (RESPONSE[way] + EXPECTED) / 2
        )

    def test_is_averaged_with_another_session(
        self, when: When, question: Question, opposite: bool, way: Way
    ) -> None:
        trials = [planned(0, "this", question, opposite=opposite)]
        both = [
            session("P01", when, trials, [each], number=n) for n, each in ((1, way), (2, "same"))
        ]
        assert cell(loaded(*both)) == RESPONSE[way] / 2

    def test_that_was_not_reached_has_none(
        self, when: When, question: Question, opposite: bool, way: Way
    ) -> None:
        trials = [
            planned(0, "other", question, opposite=False),
            planned(1, "this", question, opposite=opposite),
        ]
        data = loaded(session("P01", when, trials, [way, None]))
        assert np.isnan(cell(data))
        assert data.empty[0, 0] == Why.NOT_REACHED
        assert (0, 0) not in data.ways

    def test_that_is_excluded_counts_for_nothing(
        self, when: When, question: Question, opposite: bool, way: Way
    ) -> None:
        trials = [planned(at, "this", question, opposite=opposite) for at in (0, 1)]
        out = [TrialExcluded(index=0, reason="a noise")]
        one = loaded(session("P01", when, trials, [way, "expected"], more=out))
        assert cell(one) == EXPECTED
        assert one.ways[0, 0] == Directions(expected=1, contrary=0, same=0)
        none = loaded(session("P01", when, trials[:1], [way], more=out))
        assert np.isnan(cell(none))
        assert none.empty[0, 0] == Why.EXCLUDED


def test_scores_of_other_answers_are_counted_beside_the_table() -> None:
    trials = [planned(at, "this", "roughness", opposite=False) for at in range(3)]
    data = loaded(session("P01", "always", trials, ["expected", "contrary", "same"]))
    assert data.table.scores[0, 0] == SCORE
    assert "2 of these scores were given after another answer" in " ".join(data.notes)
    assert cell(data) == EXPECTED / 3
