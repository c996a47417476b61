"""A study and its mirror image: the same p, and signs that turn where the prediction turns."""

from functools import cache

import numpy as np
import pytest

from analysis.estimates import NotEstimable
from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report
from protocol.study_file.loading import parsed_study, template
from tests.analysis.chains import chain
from tests.analysis.reports import ORIGIN, session_events

VOLTAGES = (40, 80, 120, 160)


def text(*, expected: str, rising: bool) -> str:
    """A study of changes between 0 V and four voltages, felt at one place."""
    head = template("paper").partition("[[condition]]")[0]
    conditions = []
    for voltage in VOLTAGES:
        ends = (0, voltage) if rising else (voltage, 0)
        touches = ", ".join(f'{{ place = "smooth", voltage_v = {end} }}' for end in ends)
        conditions.append(
            f'[[condition]]\nname = "{voltage} V"\nquestion = "roughness"\n'
            f'expected = "{expected}"\ntouches = [{touches}]\n'
        )
    return head + "\n".join(conditions)


@cache
def reported(expected: str, *, rising: bool) -> Report:
    study = parsed_study(text(expected=expected, rising=rising))
    rng = np.random.default_rng(3)
    sessions = [chain(session_events(study, slot, rng, measured=False)) for slot in range(8)]
    return report("a study", load_study_data(sessions, rehearsals=False), study, ORIGIN)


AS_IT_IS = ("smoother", True)
"""Friction falls as the voltage rises, and is expected to."""


@pytest.mark.parametrize("mirror", [("rougher", False), ("smoother", False), ("rougher", True)])
def test_every_p_is_the_same(mirror: tuple[str, bool]) -> None:
    one, other = (reported(each[0], rising=each[1]) for each in (AS_IT_IS, mirror))
    np.testing.assert_array_equal(one.trials.responses, other.trials.responses)
    assert one.questions.p_holm == other.questions.p_holm
    assert one.trials.directions == other.trials.directions
    slopes = one.trials.slope, other.trials.slope
    assert not any(isinstance(each, NotEstimable) for each in slopes)
    assert slopes[0].p == slopes[1].p  # type: ignore[union-attr]


def test_expected_answers_and_voltages_that_are_both_swapped_change_no_sign() -> None:
    one, other = reported("smoother", rising=True), reported("rougher", rising=False)
    slopes = one.trials.slope, other.trials.slope
    assert slopes[0].value == pytest.approx(slopes[1].value)  # type: ignore[union-attr]
    assert one.trials.orders == other.trials.orders


@pytest.mark.parametrize("mirror", [("smoother", False), ("rougher", True)])
def test_one_of_them_alone_turns_the_slope(mirror: tuple[str, bool]) -> None:
    one, other = reported("smoother", rising=True), reported(mirror[0], rising=mirror[1])
    slopes = one.trials.slope, other.trials.slope
    assert slopes[0].value == pytest.approx(-slopes[1].value)  # type: ignore[union-attr]
    ends = [np.array(each.interval) for each in slopes]  # type: ignore[union-attr]
    np.testing.assert_allclose(ends[0], -ends[1][::-1], rtol=1e-9)
