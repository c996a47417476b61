"""Opening trials, a baseline without a signal and a signal with one, and practice to repeat."""

import pytest

from protocol.study.study_question import facts_of_trial
from protocol.study_file.loading import StudyError, parsed_study, template
from tests.protocol.studies import unasked

PAPER = template("paper")


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        (
            "voltage_v = 0 }]",
            "voltage_v = 50 }]",
            r"study.toml:48: opening baseline, touch 1: a baseline must be without a signal, "
            r'got 50 V; write voltage_v = 0, or kind = "signal"$',
        ),
        ("voltage_v = 0 }]", "voltage_v = 0, ramp_to_v = 9 }]", "without a signal, got 9 V"),
        (
            "voltage_v = 100 }]",
            "voltage_v = 0 }]",
            r"study.toml:54: opening signal: a signal must be driven in at least one touch, "
            r"got 0 V throughout; give its touches a voltage_v",
        ),
    ],
)
def test_a_baseline_is_without_a_signal_and_a_signal_is_not(
    right: str, wrong: str, message: str
) -> None:
    assert right in PAPER
    with pytest.raises(StudyError, match=message):
        parsed_study(PAPER.replace(right, wrong, 1))


@pytest.mark.parametrize(
    "key", ['kind = "baseline"', 'kind = "signal"', "touches = [{ place", "voltage_v = 100 }]"]
)
def test_an_opening_that_is_not_known_is_not_called_undriven_or_driven(key: str) -> None:
    with pytest.raises(StudyError, match=r"study\.toml:\d+: opening") as caught:
        parsed_study(PAPER.replace(key, f"x{key}", 1))
    rules = " ".join(problem.rule for problem in caught.value.problems)
    assert "driven" not in rules
    assert "without" not in rules


REPEATED = "\n[as_instructed]\npractise_until = 3\npractise_of = 4\n"


def test_practice_can_be_repeated_only_where_there_is_practice() -> None:
    message = (
        r"study\.toml:\d+: design\.practice_trials: must be above 0 where "
        r"as_instructed\.practise_until = 3, got 0; give practice_trials, or leave practise_until "
        r"out$"
    )
    with pytest.raises(StudyError, match=message):
        parsed_study(PAPER + REPEATED)
    practised = PAPER.replace("[design]", "[design]\npractice_trials = 2")
    assert parsed_study(practised + REPEATED).as_instructed.practise_until == 3


def test_practice_that_cannot_be_read_is_not_called_missing() -> None:
    unreadable = PAPER.replace("[design]", "[design]\npractice_trials = 99")
    with pytest.raises(StudyError, match=r"practice_trials: must be at most 20") as caught:
        parsed_study(unreadable + REPEATED)
    assert len(caught.value.problems) == 1


RATED = unasked(PAPER)


def test_conditions_are_all_asked_about_or_all_rated() -> None:
    assert parsed_study(RATED).absolute
    assert not parsed_study(PAPER).absolute
    asked = 'name = "voltage"\nquestion = "roughness"\nexpected = "smoother"'
    mixed = RATED.replace('name = "voltage"', asked, 1)
    message = (
        r"condition frequency, question: must be given, as in other conditions, got nothing; or "
        r"leave it out in all of them"
    )
    with pytest.raises(StudyError, match=message):
        parsed_study(mixed)


def test_a_condition_without_a_question_expects_no_answer() -> None:
    wrong = PAPER.replace('question = "strength"\n', "", 1)
    message = r"condition frequency, expected: must be left out without a question, got 'stronger'"
    with pytest.raises(StudyError, match=message):
        parsed_study(wrong)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        (
            "[exclusions]\nmax_false_alarms = 0.2",
            r"max_false_alarms: must be left out where no condition has a question, got "
            r"0\.2; a score of a catch trial is no alarm",
        ),
        (
            '[rating]\nscore_when = "agrees"',
            r"rating\.score_when: must be left out where no condition has a question, got "
            r"'agrees'; each trial is scored",
        ),
        (
            "[design]\nrepeats = 2\nopposite_repeats = 1",
            r"design\.opposite_repeats: must be 0 if no condition has an opposite, got 1",
        ),
        *(
            (
                '[[question]]\nname = "why"\nkind = "text"\ntext = { en = "Why?", zh = "?" }\n'
                f"asked_if = {rule}",
                "asked_if: must name a question before this one, got .*; known: score$",
            )
            for rule in (
                '{ question = "change", is = ["smoother"] }',
                '{ question = "noticed", is = ["yes"] }',
                '{ question = "agrees", is = ["yes"] }',
            )
        ),
    ],
)
def test_what_only_questions_give_is_refused_without_them(section: str, message: str) -> None:
    key = section.splitlines()[0]
    text = RATED.replace(f"{key}\n", f"{section}\n", 1)
    with pytest.raises(StudyError, match=message):
        parsed_study(text if key in RATED else f"{text}\n{section}\n")


def test_a_question_may_depend_on_the_score_of_what_was_felt() -> None:
    own = (
        '[[question]]\nname = "why"\nkind = "text"\ntext = { en = "Why?", zh = "?" }\n'
        'asked_if = { question = "score", at_least = 8 }\n'
    )
    assert parsed_study(f"{RATED}\n{own}").question[0].asked_if
    assert facts_of_trial(None, None, None, 7) == {"score": 7}
    assert facts_of_trial(None, None, None, None) == {}
