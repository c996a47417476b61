"""Opening trials, a baseline without a signal and a signal with one, and practice to repeat."""

import pytest

from protocol.study_file.loading import StudyError, parsed_study, template

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
