"""Assertions for studies' own tests: they pass for a valid study and name what is wrong."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from protocol import assertions as that
from protocol.plan.plan import plan
from protocol.study_file.loading import parsed_study, template

STUDY = parsed_study(template("extended"))
COHORT = [plan(STUDY, slot) for slot in range(10)]


def test_a_valid_study_passes() -> None:
    that.assert_proved(STUDY, COHORT)
    that.assert_never_above(COHORT, voltage_v=200)
    that.assert_each_condition(STUDY, COHORT, times=4)
    that.assert_shorter_than(STUDY, COHORT, minutes=45)
    that.assert_beam_swaps(STUDY, COHORT, at_most=12)
    that.assert_balanced(STUDY, COHORT)


@pytest.mark.parametrize(
    ("claim", "message"),
    [
        (lambda: that.assert_never_above(COHORT, voltage_v=120), "at most 120 V, got 200 V in tri"),
        (
            lambda: that.assert_each_condition(STUDY, COHORT, times=2),
            "have 2 trials of frequency, got 4 for participant 1, session 1",
        ),
        (lambda: that.assert_shorter_than(STUDY, COHORT, minutes=20), r"less than 20 min, got 2\d"),
        (lambda: that.assert_beam_swaps(STUDY, COHORT, at_most=3), "at most 3 .* got 12 for part"),
        (lambda: that.assert_balanced(STUDY, COHORT[:9]), "over 9 participants, got counts that"),
        (
            lambda: that.assert_proved(STUDY, []),
            "cohort: there must be at least one plan, got none",
        ),
        (lambda: that.assert_balanced(STUDY, []), "balanced over 0 participants"),
        (
            lambda: that.assert_proved(STUDY, [replace(COHORT[0], slot=1)]),
            r"slots must be numbered from 0, got \[1\]",
        ),
    ],
)
def test_a_failure_names_what_is_wrong(claim: Callable[[], None], message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        claim()
