"""The study's own rules: which trials and which people they take out, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.loading.exclusion_rules import OLDER_RULES, RULES, rules_in_words
from analysis.loading.records import Exclusion
from analysis.loading.study_data import NothingToReport, StudyData, load_study_data
from protocol.journal.events import Answered, Event, SessionOpened, TrialExcluded
from protocol.study.rules import Exclusions
from tests.analysis.chains import chain, published_chain
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


def answered_as(events: list[Event], *, agrees: bool, score: int | None) -> list[Event]:
    return [
        replace(event, agrees=agrees, score=score)
        if isinstance(event, Answered) and event.kind == "trial"
        else event
        for event in events
    ]


def begun_under(events: list[Event], version: str) -> list[Event]:
    opened, *others = events
    assert isinstance(opened, SessionOpened)
    return [replace(opened, versions={"touchbeam": version}), *others]


FEW = Exclusions(max_missing_scores=0.5)


def test_who_notices_nothing_has_answered_every_trial_and_stays() -> None:
    found = loaded(answered_as(paper_session(), agrees=False, score=None), rules=FEW)
    assert (found.table.subjects, found.left_out, found.unnoticing) == (("P01",), (), ())
    assert not found.table.given.any()


def test_trials_without_an_answer_are_counted_against_the_limit() -> None:
    """Of five planned ones: 1 answered in a session that ended, and 5 without a score."""
    ended = paper_session()
    first = next(at for at, it in enumerate(ended) if getattr(it, "kind", "") == "trial")
    answered = next(at for at, it in enumerate(ended) if at > first and isinstance(it, Answered))
    unscored = answered_as(paper_session(1), agrees=True, score=None)
    found = loaded(ended[: answered + 1], unscored, paper_session(2), rules=FEW)
    assert found.table.subjects == ("P03",)
    assert [(each.participant, each.why) for each in found.left_out] == [
        ("P01", "4 of 5 planned trials without an answer, more than 50%"),
        ("P02", "5 of 5 planned trials without an answer, more than 50%"),
    ]


def test_a_trial_that_the_operator_excluded_is_neither_planned_nor_missing() -> None:
    trials = [it.index for it in paper_session() if isinstance(it, Answered) and it.kind == "trial"]
    gone = [TrialExcluded(index=index, reason="a noise") for index in trials[1:]]
    found = loaded([*paper_session(), *gone], rules=Exclusions(max_missing_scores=0.0))
    assert found.table.subjects == ("P01",)
    assert {each.by for each in found.left_out} == {"operator"}


def test_a_trial_that_is_answered_late_is_answered() -> None:
    late = with_reaction(paper_session(), 4, 9.0)
    rules = Exclusions(max_reaction_s=5.0, max_missing_scores=0.0)
    assert loaded(late, rules=rules).table.subjects == ("P01",)


def test_a_blank_of_a_published_table_is_missing_and_a_score_is_not() -> None:
    chains = [
        published_chain("P01", {"a": 3.0, "b": None, "c": None}),
        published_chain("P02", {"a": 3.0, "b": 4.0, "c": None}),
    ]
    found = load_study_data(chains, rehearsals=False, rules=FEW)
    assert found.table.subjects == ("P02",)
    assert found.left_out[0].why == "2 of 3 planned trials without an answer, more than 50%"


@pytest.mark.parametrize(
    ("versions", "older"),
    [
        (("1.0.0", "0.9"), True),
        (("1.0.0", "2.0.0.dev0"), True),
        (("1.0.0, then 2.0.0", "1.0.0, then 2.0.0"), False),
    ],
)
def test_a_study_of_version_1_keeps_its_rule_and_names_whom_it_left_out(
    versions: tuple[str, str], older: bool
) -> None:
    unnoticing = answered_as(paper_session(), agrees=False, score=None)
    both = zip((unnoticing, paper_session(1)), versions, strict=True)
    found = loaded(*(begun_under(each, version) for each, version in both), rules=FEW)
    assert found.older_rules is older
    assert found.table.subjects == (("P02",) if older else ("P01", "P02"))
    assert found.unnoticing == (("P01",) if older else ())
    assert [each.why for each in found.left_out] == [
        "5 of 5 scores missing, more than 50%" for _ in range(older)
    ]
    (words,) = rules_in_words(FEW, older=older)
    assert ("scores missing" in words) is older


def test_who_is_left_out_by_both_rules_is_not_left_out_for_not_noticing() -> None:
    unscored = answered_as(paper_session(), agrees=True, score=None)
    sessions = [begun_under(each, "1.0.0") for each in (unscored, paper_session(1))]
    found = loaded(*sessions, rules=FEW)
    assert (found.table.subjects, found.unnoticing) == (("P02",), ())


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
    assert RULES.keys() == OLDER_RULES.keys() == Exclusions.model_fields.keys()
