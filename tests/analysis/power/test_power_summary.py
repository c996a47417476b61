"""The summary of studies whose numbers are known, and their Monte Carlo errors."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.power.designs import Design
from analysis.power.power_report import (
    answer,
    design_answer,
    lines_of_estimates,
    warnings,
)
from analysis.power.power_summary import Summary, claims, ratio, summary, too_often
from analysis.power.study_records import (
    BY_GROUP,
    GROUP_SCORE,
    Asked,
    Estimate,
    Record,
    Records,
    record_of_tables,
)
from protocol.registration.registration import FOLLOWS, NOTICED, OMNIBUS

DESIGN = Design(participants=9, repeats=1)
NAMES = Asked(conditions=("a", "b", "c", "d", "e"))


def records_of(tables: Sequence[FloatArray], asked: Asked | None = None) -> Records:
    """Records of tables in which every change is noticed; people alternate between groups."""
    people, conditions = tables[0].shape
    asked = asked or Asked(conditions=tuple("abcdefghijkl"[:conditions]))
    groups = np.arange(people) % max(1, len(asked.groups))
    noticed = np.zeros((people, conditions + 1, 2), dtype=np.int64)
    of_studies = (
        record_of_tables(asked, each, each, noticed, each[..., None], groups) for each in tables
    )
    return Records.of(asked, list(of_studies))


def p_of(asked: Asked, records: Records, name: str) -> FloatArray:
    """The p of a test in each study, to change at will."""
    return records.p[:, asked.tests.index(name)]


def tables(seed: int, studies: int, effects: tuple[float, ...] = (0, 0, 0, 0, 0)) -> FloatArray:
    """Whole scores from 0 to 10 with people of their own bias, on a ceiling for some."""
    rng = np.random.default_rng(seed)
    bias = rng.normal(7.5, 1.0, (studies, 9, 1))
    noise = rng.normal(0, 1.2, (studies, 9, 5))
    return np.asarray(np.clip(np.round(bias + np.array(effects) + noise), 0, 10))


@cache
def _records(seed: int, studies: int, effects: tuple[float, ...]) -> Records:
    return records_of(list(tables(seed, studies, effects)))


def records_by(seed: int, studies: int, effects: tuple[float, ...] = (0, 0, 0, 0, 0)) -> Records:
    """Records of the `tables` with these arguments, to change at will."""
    return deepcopy(_records(seed, studies, effects))


NONE = Records.of(NAMES, [])


def summed(records: Records, null: Records = NONE) -> Summary:
    return summary(DESIGN, NAMES, records, null)


def test_a_ratio_has_the_error_of_independent_studies() -> None:
    rng = np.random.default_rng(3)
    below = rng.integers(1, 10, (2000, 400)).astype(float)
    above = rng.binomial(below.astype(int), 0.9).astype(float)
    several = [ratio(a, b) for a, b in zip(above, below, strict=True)]
    spread = np.std([one.value for one in several])
    assert np.mean([one.error for one in several]) == pytest.approx(spread, rel=0.05)
    assert np.isnan(ratio(np.zeros(3), np.zeros(3)).value)


def test_a_share_of_all_studies_is_not_known_without_error() -> None:
    sure = ratio(np.ones(200), np.ones(200))
    assert sure.value == 1.0
    assert sure.error == pytest.approx(np.sqrt(201 / 200) / 202)
    assert ratio(np.zeros(200), np.ones(200)).error == pytest.approx(sure.error)


def test_no_null_cohort_in_twenty_has_a_false_claim() -> None:
    null = records_by(5, 2000)
    claimed = summed(null, null).any_false_claim
    assert claimed.value <= 0.05 + 2 * claimed.error
    assert claimed.error == pytest.approx(np.sqrt(0.05 * 0.95 / 2000), rel=0.3)
    # Two questions, each on its own, would have made more than one correction over both.
    asked = replace(NAMES, contrasts=(0.1, 0.2, 0.3, 0.4, 0.6))
    p = np.random.default_rng(7).uniform(size=(4000, len(asked.tests)))
    p[:, len(asked.family) :] = np.nan
    p[:, asked.tests.index(NOTICED)] = np.nan
    either = np.logical_or(*(claims(asked, p)[name] for name in (OMNIBUS, FOLLOWS)))
    assert either.mean() <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / 4000)
    questions = [asked.tests.index(name) for name in (OMNIBUS, FOLLOWS)]
    assert (p[:, questions] < 0.05).any(axis=1).mean() > 0.08


def test_power_is_the_share_of_studies_and_pairs_wait_for_the_omnibus_test() -> None:
    records = records_by(6, 400, (0, 0, 0, 0, 2.5))
    report = summed(records)
    by_name = {test.name: test for test in report.tests}
    differ = by_name["conditions differ"]
    assert differ.power.value == pytest.approx((p_of(NAMES, records, OMNIBUS) < 0.05).mean())
    assert differ.power.value > 0.9
    for test in (by_name[name] for name in NAMES.pairs):
        assert test.after == ("conditions differ",)
        assert test.supported.value <= min(test.power.value, differ.supported.value)
    assert by_name["a - e"].power.value > by_name["a - b"].power.value


def test_t_intervals_of_differences_cover_the_mean_of_all_studies() -> None:
    report = summed(records_by(7, 1500, (0, 0, 0, 0, 2.0)))
    by_name = {estimate.name: estimate for estimate in report.estimates}
    big, none = by_name["mean difference a - e"], by_name["mean difference a - b"]
    for estimate in (big, none):
        assert abs(estimate.coverage.value - 0.95) < 4 * estimate.coverage.error
        assert estimate.bias.value == pytest.approx(0, abs=1e-9)
        assert estimate.estimable.value == 1
        assert 3 * estimate.rmse.value < estimate.width.value < 6 * estimate.rmse.value
    assert big.truth < -1 < none.truth
    # A bias of 0 by definition, so that the terminal leaves it out.
    _, *lines, _ = lines_of_estimates(report)
    assert {line[1] for line in lines if line[0] in by_name} == {"–"}


def test_a_pair_of_scores_of_one_person_has_no_interval() -> None:
    scores = np.full((9, 2), np.nan)
    scores[:2], scores[2, 0] = [[1.0, 2.0], [3.0, 5.0]], 4.0
    alone = np.where(np.arange(9)[:, None] == 0, scores, np.nan)
    records = records_of([scores, alone])
    number, error, *_, width = records.estimates[0, 0]
    assert (number, error) == (1, -1.5)
    assert width == pytest.approx(12.706 * 2 * 0.5, rel=1e-4)  # t with 1 df, SE 1/2
    assert (records.estimates[1, 0] == 0).all()
    (estimate,) = summary(DESIGN, Asked(conditions=("a", "b")), records, records).estimates
    assert estimate.estimable.value == 0.5
    assert (estimate.truth, estimate.coverage.value) == (-1.5, 1)


def test_estimates_add_up_over_studies() -> None:
    asked = Asked(conditions=NAMES.conditions, models=True)
    both = [
        Estimate(number=9, error=9.0, squared=36.0, covered=9, width=18.0),
        Estimate(number=1, error=1.0, squared=4.0, covered=0, width=2.0),
    ]
    records = Records.of(asked, [Record({}, {"M2 gain": sums}) for sums in both])
    report = summary(DESIGN, asked, records, Records.of(asked, []))
    by_name = {estimate.name: estimate for estimate in report.estimates}
    gain = by_name["M2 gain"]
    assert (gain.bias.value, gain.rmse.value, gain.width.value) == (1.0, 2.0, 2.0)
    assert (gain.coverage.value, gain.estimable.value) == (0.9, 10 / 18)
    nothing = by_name["M2 group's gain"]
    assert nothing.estimable.value == 0
    assert np.isnan([nothing.bias.value, nothing.rmse.value, nothing.coverage.value]).all()


def test_subjects_who_are_left_out_count_for_nothing() -> None:
    scores = tables(9, 4, (0, 0, 0, 1, 2))
    with_empty = np.concatenate([scores, np.full((4, 2, 5), np.nan)], axis=1)
    for more, few in zip(records_of(list(with_empty)), records_of(list(scores)), strict=True):
        np.testing.assert_array_equal(more, few)
    nobody = records_of([np.full((9, 5), np.nan)])
    assert np.isnan(nobody.p).all()
    assert not nobody.estimates.any()


def test_the_answer_says_which_condition_is_above_which() -> None:
    records = records_by(6, 200, (0, 0, 0, 0, 3.5))
    begin = "9 participants x 1 repeat: 99% power to tell that the conditions"
    assert design_answer(summed(records)).startswith(begin)
    nothing = design_answer(summed(records_by(5, 50)))
    assert ", less than 80% power for every pair of conditions." in nothing
    p_of(NAMES, records, "a - e")[:] = 0.01
    assert "80% power for e above a" in design_answer(summed(records))


def test_of_several_designs_the_smallest_that_does_is_the_answer() -> None:
    weak, strong = records_by(5, 50), records_by(6, 50, (0, 0, 0, 0, 3.5))
    designs = [Design(participants=people, repeats=1) for people in (6, 9, 12)]
    null = records_by(5, 10)
    reports = [
        summary(design, NAMES, records, null)
        for design, records in zip(designs, (weak, strong, strong), strict=True)
    ]
    smallest = "The smallest design with 80% power to tell that the conditions differ: 9 parti"
    assert answer(reports[::-1]).startswith(smallest)
    largest = "No design has 80% power; the largest: 6 participants"
    assert answer([reports[0], reports[0]]).startswith(largest)


def test_a_claim_that_is_not_protected_is_not_counted_and_told() -> None:
    rng = np.random.default_rng(8)
    scatter = np.geomspace(0.05, 2.5, 9)[:, None]
    null = records_of(list(5 + scatter * rng.standard_normal((400, 9, 5))))
    records = records_by(6, 50, (0, 0, 0, 0, 2.5))
    held = next(test for test in summed(records, null).tests if test.name == OMNIBUS)
    assert np.isfinite(held.supported.value)  # however differently people scatter
    p_of(NAMES, null, OMNIBUS)[::5] = 0.001
    report = summed(records, null)
    differ, *_ = report.tests
    assert differ.false.value > 0.1
    assert np.isfinite(differ.power.value)
    assert np.isnan(differ.supported.value)
    (line,) = warnings([report])
    assert line.startswith("9 participants x 1 repeat: without any effect ")
    assert "where at most 5% should; do not claim 'conditions differ', which" in line
    assert warnings([summed(records, records_by(5, 400))]) == []


def test_intervals_that_miss_the_truth_are_told() -> None:
    records = records_by(6, 400)
    records.estimates[:, NAMES.estimates.index("mean difference a - b"), -1] /= 3
    (line,) = warnings([summed(records, records_by(5, 400))])
    assert "the 95% intervals of mean difference a - b hold the truth in " in line


DESIGNED = Asked(
    conditions=("low a", "low b", "low c", "high a", "high b", "high c"),
    groups=("young", "old"),
    factors={"voltage": ("low", "high"), "frequency": ("a", "b", "c")},
    contrasts=(0.1, 0.1, 0.1, 0.3, 0.3, 0.3),
)


def test_groups_and_factors_are_tested_and_any_claim_without_effect_is_rare() -> None:
    rng = np.random.default_rng(11)
    null = rng.normal(5, 1, (300, 16, 6)) + rng.normal(0, 1, (300, 16, 1))
    old, high = np.arange(16) % 2 == 1, np.arange(6) >= 3
    # Old people score 2 points more, and feel the voltage twice as much.
    effect = 2.0 * old[:, None] + 2.0 * np.outer(1 + old, high)
    without = records_of(list(null), DESIGNED)
    records = records_of(list(null[:60] + effect), DESIGNED)
    report = summary(DESIGN, DESIGNED, records, without)
    by_name = {test.name: test for test in report.tests}
    for strong in (GROUP_SCORE, BY_GROUP, "effect of voltage"):
        assert by_name[strong].supported.value > 0.8
    assert by_name["effect of frequency"].supported.value < 0.1
    apart = by_name["high a: young - old between groups"]
    assert apart.after == (GROUP_SCORE, BY_GROUP)
    assert apart.power.value > by_name["low a: young - old between groups"].power.value
    assert not too_often(report.any_false_claim)
    # Each question on its own would have been answered wrongly far more often.
    of_design = DESIGNED.tests[DESIGNED.tests.index(GROUP_SCORE) :]
    p = np.column_stack([p_of(DESIGNED, without, name) for name in of_design])
    assert (p < 0.05).any(axis=1).mean() > 0.1
    assert by_name["young - old between groups"].supported.value > 0.9
    assert f"80% power for '{GROUP_SCORE}', " in design_answer(report)


def test_responses_follow_the_prediction_only_in_the_order_of_the_contrasts() -> None:
    asked = Asked(conditions=NAMES.conditions, contrasts=(0.1, 0.2, 0.3, 0.4, 0.5))
    rising, folded = (-2.0, -1.0, 0.0, 1.0, 2.0), (-2.0, 1.0, 2.0, 1.0, -2.0)
    along, across = (records_of(list(tables(13, 60, of)), asked) for of in (rising, folded))
    null = records_of(list(tables(14, 200)), asked)
    for records, follows in ((along, True), (across, False)):
        report = summary(DESIGN, asked, records, null)
        by_name = {test.name: test for test in report.tests}
        assert by_name[OMNIBUS].supported.value > 0.9, "the conditions differ in either order"
        assert by_name[FOLLOWS].after == ()
        # The least p of five conditions is 1/60, where contrasts rise or fall.
        supported = by_name[FOLLOWS].supported.value
        assert supported > 0.7 if follows else supported < 0.1
        assert not too_often(by_name[FOLLOWS].false)
        assert "% power to tell that responses follow the prediction, " in design_answer(report)


def test_a_group_of_which_nobody_is_left_has_no_test() -> None:
    scores = np.random.default_rng(12).normal(5, 1, (3, 8, 6))
    scores[1, 1::2] = np.nan
    scores[2] = np.nan
    records = records_of(list(scores), DESIGNED)
    assert (~np.isnan(p_of(DESIGNED, records, GROUP_SCORE))).tolist() == [True, False, False]
    assert not np.isnan(p_of(DESIGNED, records, "effect of voltage")[:2]).any()
