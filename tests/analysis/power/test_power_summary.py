"""The summary of studies whose numbers are known, and their Monte Carlo errors."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.power.designs import Design
from analysis.power.null_cohorts import DIFFERING, KINDS, NOTICING, SHUFFLED
from analysis.power.power_report import (
    answer,
    design_answer,
    lines_of_tests,
    power_record,
    warnings,
)
from analysis.power.power_summary import Summary, claims, ratio, summary, too_often
from analysis.power.study_records import (
    BY_GROUP,
    GROUP_SCORE,
    LEVELS,
    MEAN_GAIN,
    Asked,
    Record,
    Records,
    Sums,
    record_of_tables,
)
from protocol.registration.registration import FOLLOWS, GAINS, NOTICED, OMNIBUS
from protocol.study_file.loading import parsed_study, template

DESIGN = Design(participants=9, repeats=1)
NAMES = Asked(conditions=("a", "b", "c", "d", "e"))


def records_of(tables: Sequence[FloatArray], asked: Asked | None = None) -> Records:
    """Records of tables in which every change is noticed; people alternate between groups."""
    people, conditions = tables[0].shape
    asked = asked or Asked(conditions=tuple("abcdefghijkl"[:conditions]))
    groups = np.arange(people) % max(1, len(asked.groups))
    noticed = np.zeros((people, conditions + 1, 2), dtype=np.int64)
    of_studies = (
        record_of_tables(asked, each, noticed, each[..., None], groups) for each in tables
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


def of_each(null: Records) -> Mapping[str, Records]:
    """The same null cohorts as each kind of them."""
    return {kind.name: null for kind in KINDS}


def summed(records: Records, null: Records = NONE) -> Summary:
    return summary(DESIGN, NAMES, records, of_each(null))


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
    claimed = summed(null, null).any_false_claim[SHUFFLED.name]
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


def test_estimates_add_up_over_studies() -> None:
    asked = Asked(conditions=NAMES.conditions, models=True)
    both = [
        Sums(number=9, error=9.0, squared=36.0, covered=9, width=18.0),
        Sums(number=1, error=1.0, squared=4.0, covered=0, width=2.0),
    ]
    of_studies = [Record({}, {LEVELS: sums}, told=float(sums.covered > 0)) for sums in both]
    records = Records.of(asked, of_studies)
    report = summary(DESIGN, asked, records, of_each(Records.of(asked, [])))
    nothing, levels = report.estimates
    assert (levels.name, nothing.name) == (LEVELS, MEAN_GAIN)
    assert (levels.bias.value, levels.rmse.value, levels.width.value) == (1.0, 2.0, 2.0)
    assert (levels.coverage.value, levels.estimable.value) == (0.9, 10 / 18)
    assert nothing.estimable.value == 0
    assert np.isnan([nothing.bias.value, nothing.rmse.value, nothing.coverage.value]).all()
    assert report.told.value == 0.5
    assert GAINS not in [test.name for test in report.tests], "no gain could be estimated"
    record = power_record([report], parsed_study(template("paper")), "", 1)
    assert record["design"]["told"] == 0.5
    assert record["design"]["told_mc_error"] == pytest.approx(np.sqrt(0.25 / 2))
    begin = "9 participants x 1 repeat: levels to within ±1.0 points, gains of people told in 50%"
    assert design_answer(report).startswith(begin)


def test_a_study_whose_gains_can_be_estimated_has_their_test() -> None:
    asked = Asked(conditions=NAMES.conditions, models=True)
    several = [Record({GAINS: 0.01}, {}, told=0.0), Record({}, {}, told=0.0)]
    report = summary(DESIGN, asked, Records.of(asked, several), of_each(Records.of(asked, [])))
    gains = report.tests[-1]
    assert (gains.name, gains.after, gains.power.value) == (GAINS, None, 0.5)
    assert np.isnan([gains.supported.value, *(of.value for of in gains.false.values())]).all()


def test_subjects_who_are_left_out_count_for_nothing() -> None:
    scores = tables(9, 4, (0, 0, 0, 1, 2))
    with_empty = np.concatenate([scores, np.full((4, 2, 5), np.nan)], axis=1)
    more, few = records_of(list(with_empty)), records_of(list(scores))
    np.testing.assert_array_equal(more.p, few.p)
    assert np.isnan(records_of([np.full((9, 5), np.nan)]).p).all()


def test_the_answer_says_which_conditions_are_told_apart() -> None:
    records = records_by(6, 200, (0, 0, 0, 0, 3.5))
    begin = "9 participants x 1 repeat: 99% power to tell that the conditions"
    assert design_answer(summed(records)).startswith(begin)
    nothing = design_answer(summed(records_by(5, 50)))
    assert ", less than 80% power for every pair of conditions." in nothing
    p_of(NAMES, records, "a - e")[:] = 0.01
    assert ", at least 80% power to tell apart a and e." in design_answer(summed(records))


def test_the_answer_speaks_of_groups_and_factors_only_where_there_is_something_to_find() -> None:
    groups = replace(NAMES, groups=("old", "young"))
    factors = {"force": ("1", "2"), "speed": ("1", "2")}
    for asked, said in (
        (groups, ", less than 80% power for every question about groups, "),
        (replace(NAMES, factors=factors), ", less than 80% power for every question about factors"),
        (
            replace(groups, factors=factors),
            ", less than 80% power for every question about groups and factors, ",
        ),
        (
            replace(groups, alike=True),
            ", nothing to find between groups, which are drawn from the same people, less than ",
        ),
    ):
        p = np.full((20, len(asked.tests)), 0.5)
        nothing = Records(p, np.zeros((20, 0, 5)), np.full(20, np.nan))
        assert said in design_answer(summary(DESIGN, asked, nothing, of_each(nothing)))


def test_of_several_designs_the_smallest_that_does_is_the_answer() -> None:
    weak, strong = records_by(5, 50), records_by(6, 50, (0, 0, 0, 0, 3.5))
    designs = [Design(participants=people, repeats=1) for people in (6, 9, 12)]
    null = records_by(5, 10)
    reports = [
        summary(design, NAMES, records, of_each(null))
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
    assert differ.false[SHUFFLED.name].value > 0.1
    assert np.isfinite(differ.power.value)
    assert np.isnan(differ.supported.value)
    (line,) = warnings([report])
    begin = f"9 participants x 1 repeat: of {SHUFFLED.name!r} "
    assert line.startswith(begin)
    assert "where at most 5% should; do not claim 'conditions differ', which" in line
    assert warnings([summed(records, records_by(5, 400))]) == []


def test_a_claim_that_is_true_of_a_kind_of_null_cohorts_is_no_false_one() -> None:
    asked = replace(NAMES, contrasts=(0.1, 0.2, 0.3, 0.4, 0.6))
    p = np.full((200, len(asked.tests)), 0.5)
    p[:, asked.tests.index(NOTICED)] = np.nan
    nothing = Records(p, np.zeros((200, 0, 5)), np.full(200, np.nan))
    certain = nothing._replace(p=np.where(np.isnan(p), np.nan, 0.001))
    nulls = {SHUFFLED.name: nothing, DIFFERING.name: certain, NOTICING.name: certain}
    report = summary(DESIGN, asked, certain, nulls)
    by_name = {test.name: test for test in report.tests}
    differ, follows = by_name[OMNIBUS], by_name[FOLLOWS]
    assert differ.supported.value == 1
    assert np.isnan(follows.supported.value), "it is claimed of people without a gain"
    assert follows.false[DIFFERING.name].value == 1
    assert [kind for kind, of in differ.false.items() if of.value >= 0] == [SHUFFLED.name]
    anything = report.any_false_claim
    assert (anything[SHUFFLED.name].value, anything[DIFFERING.name].value) == (0, 1)
    (line,) = warnings([report])
    assert f"of {DIFFERING.name!r} 100% of reports claim something false" in line
    assert "do not claim 'ratings follow the prediction'" in line
    null = power_record([report], parsed_study(template("paper")), "", 1)["null"]
    assert (null["studies"], null["any_supported"]) == (200, 0.0)
    assert [kind["name"] for kind in null["kinds"]] == [kind.name for kind in KINDS]
    assert [kind["any_supported"] for kind in null["kinds"]] == [0.0, 1.0, None]
    header, *_, footer = lines_of_tests(report)
    assert header[3:] == [kind.name for kind in KINDS]
    assert footer[4] == "1.000 ±0.005"


def test_intervals_that_miss_the_truth_are_told() -> None:
    asked = Asked(conditions=NAMES.conditions, models=True)
    sums = Sums(number=9, error=0.0, squared=9.0, covered=7, width=18.0)
    of_studies = [Record({}, {LEVELS: sums}, told=0.0) for _ in range(100)]
    null = records_of(list(tables(5, 100)), asked)
    (line,) = warnings([summary(DESIGN, asked, Records.of(asked, of_studies), of_each(null))])
    assert "the 95% intervals of levels hold the truth in 78%" in line


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
    report = summary(DESIGN, DESIGNED, records, of_each(without))
    by_name = {test.name: test for test in report.tests}
    for strong in (GROUP_SCORE, BY_GROUP, "effect of voltage"):
        assert by_name[strong].supported.value > 0.8
    assert by_name["effect of frequency"].supported.value < 0.1
    apart = by_name["high a: young - old between groups"]
    assert apart.after == (GROUP_SCORE, BY_GROUP)
    assert apart.power.value > by_name["low a: young - old between groups"].power.value
    assert not too_often(report.any_false_claim[SHUFFLED.name])
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
        report = summary(DESIGN, asked, records, of_each(null))
        by_name = {test.name: test for test in report.tests}
        assert by_name[OMNIBUS].supported.value > 0.9, "the conditions differ in either order"
        assert by_name[FOLLOWS].after == ()
        # The least p of five conditions is 1/60, where contrasts rise or fall.
        supported = by_name[FOLLOWS].supported.value
        assert supported > 0.7 if follows else supported < 0.1
        assert not too_often(by_name[FOLLOWS].false[SHUFFLED.name])
        assert "% power to tell that responses follow the prediction, " in design_answer(report)


def test_a_group_of_which_nobody_is_left_has_no_test() -> None:
    scores = np.random.default_rng(12).normal(5, 1, (3, 8, 6))
    scores[1, 1::2] = np.nan
    scores[2] = np.nan
    records = records_of(list(scores), DESIGNED)
    assert (~np.isnan(p_of(DESIGNED, records, GROUP_SCORE))).tolist() == [True, False, False]
    assert not np.isnan(p_of(DESIGNED, records, "effect of voltage")[:2]).any()
