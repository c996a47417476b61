"""The study's own rules: which trials and which people they take out, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.loading.records import Exclusion
from analysis.loading.study_data import RULES, NothingToReport, StudyData, load_study_data
from protocol.journal.events import Answered, Event
from protocol.study.rules import Exclusions
from tests.analysis.chains import chain
from tests.analysis.reports import EXTENDED, PAPER, session_events


def loaded(*sessions: list[Event], rules: Exclusions) -> StudyData:
    return load_study_data(map(chain, sessions), rehearsals=False, rules=rules)


def paper_session(slot: int = 0) -> list[Event]:
    return session_events(PAPER, slot, np.random.default_rng(3))


def with_reaction(events: list[Event], index: int, seconds: float) -> list[Event]:
    return [
        replace(event, reaction_time_s=(seconds,))
        if isinstance(event, Answered) and event.index == index
        else event
        for event in events
    ]


@pytest.mark.parametrize(
    ("seconds", "rules", "why"),
    [
        (0.1, Exclusions(min_reaction_s=0.2), "answered after 0.1 s, sooner than 0.2 s"),
        (9.0, Exclusions(max_reaction_s=5.0), "answered after 9 s, later than 5 s"),
    ],
)
def test_a_trial_answered_too_soon_or_too_late_is_left_out_and_listed(
    seconds: float, rules: Exclusions, why: str
) -> None:
    found = loaded(with_reaction(paper_session(), 4, seconds), rules=rules)
    assert found.left_out == (Exclusion(participant="P01", session=1, trial=4, by="rule", why=why),)
    assert 4 not in set(found.trials["trial_index"])
    assert set(found.touches["attempt_id"]) <= set(found.trials.index)


def test_a_participant_who_breaks_a_rule_is_left_out_and_the_others_stay() -> None:
    rng = np.random.default_rng(5)
    guesser = [
        replace(event, agrees=False)
        if isinstance(event, Answered) and event.kind == "catch"
        else event
        for event in session_events(EXTENDED, 0, rng)
    ]
    found = loaded(guesser, session_events(EXTENDED, 1, rng), rules=EXTENDED.exclusions)
    assert found.table.subjects == ("P02",)
    assert found.left_out[0].why == "a change reported on 4 of 4 catch trials, more than 50%"


def test_missing_scores_are_counted_against_the_limit() -> None:
    withheld = [
        replace(event, score=None) if isinstance(event, Answered) else event
        for event in paper_session()
    ]
    rules = Exclusions(max_missing_scores=0.9)
    found = loaded(withheld, paper_session(1), rules=rules)
    assert found.table.subjects == ("P02",)
    assert found.left_out[0].why == "5 of 5 scores missing, more than 90%"


def test_who_has_no_trial_left_is_judged_too() -> None:
    hasty = [
        replace(event, reaction_time_s=(0.1,)) if isinstance(event, Answered) else event
        for event in paper_session()
    ]
    rules = Exclusions(min_reaction_s=0.2, min_trials=1)
    found = loaded(hasty, paper_session(1), rules=rules)
    assert found.table.subjects == ("P02",)
    assert found.left_out[-1] == Exclusion(
        participant="P01", by="rule", why="0 valid trials, fewer than 1"
    )


def test_rules_that_leave_nobody_say_so() -> None:
    with pytest.raises(NothingToReport, match="leave nobody: P01 has 5 valid trials, fewer than 6"):
        loaded(paper_session(), rules=Exclusions(min_trials=6))


def test_every_rule_of_the_study_file_is_judged() -> None:
    assert RULES.keys() == Exclusions.model_fields.keys()
