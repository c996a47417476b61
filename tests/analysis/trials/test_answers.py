"""Answers to a study's own questions, summed up."""

from dataclasses import replace
from typing import Any

import pandas as pd

from analysis.export.dataset import dataset
from analysis.loading.study_data import load_study_data
from analysis.trials.answers import Answers, answers_by_question
from protocol.journal.events import Answered, Event, QuestionAnswered, StoredEvent
from protocol.journal.records import QuestionAnswer
from protocol.study.columns import COLUMNS, TAKEN
from protocol.study_file.loading import parsed_study, template
from tests.analysis.chains import chain, scored_session
from tests.protocol.studies import OWN_QUESTIONS

STUDY = parsed_study(template("paper") + OWN_QUESTIONS)
CONDITIONS = ("voltage", "frequency")


def session(who: str, pleasant: list[Any], number: int = 1, **apart: Any) -> list[StoredEvent]:
    """A session with an answer to `pleasantness` after each trial, and others apart."""
    given = iter(pleasant)
    events: list[Event] = []
    scores = [("voltage", 5), ("frequency", 6)]
    for event in scored_session(who, scores, CONDITIONS, session=number):
        told: dict[str, Any] = {"reaction_time_s": 1.0, "trace": None}
        if isinstance(event, Answered):
            about = QuestionAnswer(name="pleasantness", answer=next(given), **told)
            events.append(replace(event, questions=(about,)))
            continue
        events.append(event)
        if event.TAG == "session-opened":
            events += [
                QuestionAnswered(name=name, answer=answer, when="before", block=None, **told)
                for name, answer in apart.items()
            ]
    return chain(events)


def summed(*chains: list[StoredEvent]) -> dict[str, Answers]:
    loaded = load_study_data(chains, rehearsals=False)
    return {each.question.name: each for each in answers_by_question(STUDY, loaded.answers)}


def test_numbers_are_summed_up_by_condition() -> None:
    found = summed(session("A", [2, 5]), session("B", [4, None]))["pleasantness"]
    frequency, voltage = found.groups
    assert (frequency.name, frequency.given, frequency.skipped) == ("frequency", (5,), 1)
    assert voltage.numbers() == {
        "mean": 3,
        "sd": 2**0.5,
        "median": 3,
        "lowest": 2,
        "highest": 4,
    }
    assert "sd" not in frequency.numbers()


def test_labels_are_counted() -> None:
    found = summed(
        session("A", [1, 1], hand="left", sensations=["warmth", "sticking"]),
        session("B", [1, 1], hand="left", sensations=["warmth"]),
    )
    hand, sensations = (found[name].groups[0] for name in ("hand", "sensations"))
    assert hand.counts(found["hand"].question) == {"left": 2, "right": 0, "both": 0}
    counts = sensations.counts(found["sensations"].question)
    assert (counts["warmth"], counts["sticking"], counts["none"]) == (2, 1, 0)


def test_answers_to_a_question_that_was_of_another_kind_are_left_out() -> None:
    found = summed(session("A", [1, 1], age="old"), session("B", [1, 1], age=30))
    assert found["age"].groups[0].given == (30,)


def test_a_question_that_nobody_was_asked_is_not_there() -> None:
    assert summed(session("A", [1, 1])).keys() == {"pleasantness"}


def test_no_question_may_have_the_name_of_an_exported_column() -> None:
    assert {column.name for column in COLUMNS} <= TAKEN


def test_a_question_that_the_study_file_no_longer_has_is_exported() -> None:
    data = dataset([session("A", [1, 1], shoe_size=42)], STUDY, "0", rehearsals=False)
    assert data.trials["shoe_size"].tolist() == [42, 42]
    assert data.participants["shoe_size"].tolist() == [42]


def people(*chains: list[StoredEvent]) -> pd.DataFrame:
    return dataset(chains, STUDY, "0", rehearsals=False).participants


def test_answers_given_once_stand_with_the_participants() -> None:
    found = people(
        session("A", [1, 1], age=30, sensations=["warmth", "sticking"]),
        session("B", [1, 1], hand="left"),
    ).set_index("participant")
    assert found["age"].dropna().to_dict() == {"A": 30}
    assert found["hand"].dropna().to_dict() == {"B": "left"}
    assert found["sessions"].tolist() == [1, 1]
    assert found["session_kinds"].tolist() == [("participant",)] * 2
    assert "sensations" not in found
    assert "age_reaction_time_s" not in found


def test_a_second_session_may_repeat_an_answer_but_not_change_it() -> None:
    first, other = session("A", [1, 1], age=30, hand="left"), session("B", [1, 1], age=40)
    found = people(first, session("A", [1, 1], number=2, age=30, hand="right"), other)
    assert found["sessions"].tolist() == [2, 1]
    assert found["age"].tolist() == [30, 40]
    assert "hand" not in found
