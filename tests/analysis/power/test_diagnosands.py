"""Diagnosands of studies whose numbers are known, and their Monte Carlo errors."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.power.diagnosands import Findings, findings, ratio, too_often
from analysis.power.diagnosis import (
    BY_GROUP,
    ESTIMATES,
    GROUP_SCORE,
    Asked,
    columns,
    rows_of_tables,
)
from analysis.power.job import Design
from analysis.power.power_report import (
    design_answer,
    figures,
    left_out,
    lines_of_estimates,
    lines_of_tests,
    warnings,
)
from analysis.report.drawing import Panel, panels_files
from analysis.simulation import Tables
from protocol.registration.registration import GAINS

DESIGN = Design(participants=9, repeats=1)
NAMES = Asked(conditions=("a", "b", "c", "d", "e"))


def rows_of(tables: Sequence[FloatArray], asked: Asked | None = None) -> FloatArray:
    """Rows of complete or empty tables, without catch trials; people alternate between groups."""
    scores = np.array(tables)
    studies, people, conditions = scores.shape
    alternating = np.arange(people) % max(1, len(asked.groups if asked else ()))
    return rows_of_tables(
        Tables(
            scores=scores,
            noticed=np.zeros((studies, people, conditions + 1, 2), dtype=np.int64),
            by_session=scores[..., None],
            groups=np.tile(alternating, (studies, 1)),
        ),
        asked or Asked(conditions=tuple("abcdefghijkl"[:conditions])),
    )


def tables(seed: int, studies: int, effects: tuple[float, ...] = (0, 0, 0, 0, 0)) -> FloatArray:
    """Whole scores from 0 to 10 with people of their own bias, on a ceiling for some."""
    rng = np.random.default_rng(seed)
    bias = rng.normal(7.5, 1.0, (studies, 9, 1))
    noise = rng.normal(0, 1.2, (studies, 9, 5))
    return np.asarray(np.clip(np.round(bias + np.array(effects) + noise), 0, 10))


@cache
def _rows(seed: int, studies: int, effects: tuple[float, ...]) -> FloatArray:
    return rows_of(list(tables(seed, studies, effects)))


def rows_by(seed: int, studies: int, effects: tuple[float, ...] = (0, 0, 0, 0, 0)) -> FloatArray:
    """Rows of the `tables` with these arguments, to change at will."""
    return _rows(seed, studies, effects).copy()


def found(rows: FloatArray, null: FloatArray) -> Findings:
    return findings(DESIGN, NAMES, rows, null)


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
    null = rows_by(5, 2000)
    claimed = found(null[:10], null).any_false_claim
    assert claimed.value <= 0.05 + 2 * claimed.error
    assert claimed.error == pytest.approx(np.sqrt(0.05 * 0.95 / 2000), rel=0.3)
    # Each test on its own would have made more: 5% of each of two, and pairs beside them.
    alone = (null[:, :2] < 0.05).any(axis=1).mean()
    assert alone > claimed.value


def test_power_is_the_share_of_studies_and_pairs_wait_for_the_omnibus_test() -> None:
    rows = rows_by(6, 400, (0, 0, 0, 0, 2.5))
    made = found(rows, rows[:0])
    by_name = {test.name: test for test in made.tests}
    differ = by_name["conditions differ"]
    assert differ.power.value == pytest.approx((rows[:, 0] < 0.05).mean())
    assert differ.power.value > 0.9
    for test in made.tests[2:]:
        assert test.after == ("conditions differ",)
        assert test.supported.value <= min(test.power.value, differ.supported.value)
    assert by_name["a - e"].power.value > by_name["a - b"].power.value
    assert made.omnibus == "Friedman"


def test_a_registered_hypothesis_counts_only_with_its_sign_and_after_the_primary_one() -> None:
    rows = rows_by(6, 400, (0, 0, 0, 0, 2.5))
    names = ("e above a", "a above e", "conditions differ", "order of conditions as predicted")

    def powers(*hypotheses: str) -> list[float]:
        made = findings(DESIGN, NAMES, rows, rows[:0], hypotheses).registered
        assert [each.name for each in made] == list(hypotheses)
        return [each.power.value for each in made]

    rejected = rows[:, columns(NAMES, models=False).index("a - e p")] < 0.05
    first = powers(*names)
    assert 0.1 < first[0] <= rejected.mean()
    assert first[0] + powers("a above e")[0] == pytest.approx(rejected.mean())
    assert first[1] == 0
    assert first[2] == pytest.approx((rejected & (rows[:, 0] < 0.05)).mean(), abs=0.01)
    assert powers("conditions differ") == [pytest.approx((rows[:, 0] < 0.05).mean())]
    assert np.isnan(first[3])
    assert np.isnan(powers("order of conditions as predicted", "conditions differ")).all()


def test_t_intervals_of_differences_cover_and_have_the_right_sign() -> None:
    rows = rows_by(7, 1500, (0, 0, 0, 0, 2.0))
    known = found(rows, rows[:0])
    made = {one.name: one for one in known.estimates}
    big, none = made["mean difference a - e"], made["mean difference a - b"]
    for one in (big, none):
        assert abs(one.coverage.value - 0.95) < 4 * one.coverage.error
        assert one.bias.value == pytest.approx(0, abs=1e-9)
    # By definition, so that the terminal leaves it out.
    _, *lines, _ = lines_of_estimates(known)
    assert {line[1] for line in lines if line[0] in made} == {"–"}
    assert big.type_s.value == 0
    # Where there is no difference, none can be too large or have the wrong sign.
    assert 1 <= big.type_m.value < 1.2
    assert np.isnan(none.type_m.value)
    assert none.power.value < 0.1


def test_estimates_add_up_over_studies() -> None:
    names = columns(NAMES, models=True)
    rows = np.zeros((2, len(names)))
    gain = ESTIMATES[1]
    for what, values in {
        "count": (9, 1),
        "error": (9.0, 1.0),
        "squared error": (36.0, 4.0),
        "covered": (9, 0),
        "width": (18.0, 2.0),
        "significant": (3, 1),
        "wrong sign": (1, 0),
        "estimated size": (6.0, 2.0),
        "true size": (3.0, 1.0),
    }.items():
        rows[:, names.index(f"{gain} {what}")] = values
    null = rows_by(8, 10)
    one = next(each for each in found(rows, null).estimates if each.name == gain)
    assert (one.bias.value, one.rmse.value, one.width.value) == (1.0, 2.0, 2.0)
    assert (one.coverage.value, one.power.value) == (0.9, 0.4)
    assert (one.type_s.value, one.type_m.value) == (0.25, 2.0)


def test_subjects_who_are_left_out_count_for_nothing() -> None:
    scores = tables(9, 4, (0, 0, 0, 1, 2))
    with_empty = np.concatenate([scores, np.full((4, 2, 5), np.nan)], axis=1)
    np.testing.assert_array_equal(rows_of(list(with_empty)), rows_of(list(scores)))
    assert np.isnan(rows_of([np.full((9, 5), np.nan)])).all()


def test_the_answer_says_which_condition_is_above_which() -> None:
    rows = rows_by(6, 200, (0, 0, 0, 0, 3.5))
    said = design_answer(found(rows, rows[:0]))
    assert said.startswith("9 participants x 1 repeat: 98% power to tell that the conditions")
    assert ", less than 80% power for every pair of conditions." in design_answer(
        found(rows_by(5, 50), rows)
    )
    names = columns(NAMES, models=False)
    rows[:, names.index("a - e p")] = 0.01
    assert "80% power for e above a" in design_answer(found(rows, rows[:0]))


def test_a_claim_that_is_not_protected_is_not_counted_and_told() -> None:
    rng = np.random.default_rng(8)
    scatter = np.geomspace(0.05, 2.5, 9)[:, None]
    null = rows_of(list(5 + scatter * rng.standard_normal((400, 9, 5))))
    rows = rows_by(6, 50, (0, 0, 0, 0, 2.5))
    held = next(test for test in found(rows, null).tests if test.name == "gains differ")
    assert np.isfinite(held.supported.value)  # however differently people scatter
    null[::5, columns(NAMES, models=False).index(f"{GAINS} p")] = 0.001
    made = findings(DESIGN, NAMES, rows, null, ["gains differ", "conditions differ"])
    differ, gains, *_ = made.tests
    assert made.false_claims["gains differ"].value > 0.1
    assert np.isfinite(gains.power.value)
    assert np.isnan(gains.supported.value)
    assert differ.supported.value > 0.9
    assert all(np.isnan(each.power.value) for each in made.registered)
    (line,) = warnings([made])
    assert line.startswith("9 participants x 1 repeat: without any effect ")
    assert "where at most 5% should; do not claim 'gains differ', which" in line
    assert warnings([found(rows, rows_by(5, 400))]) == []


def test_intervals_that_miss_the_truth_are_told() -> None:
    rows = rows_by(6, 400)
    place = columns(NAMES, models=False).index("a - b error")
    rows[:, place] /= 3
    (line,) = warnings([found(rows, rows_by(5, 400))])
    assert "the 95% intervals of mean difference a - b hold the truth in " in line


def test_many_pairs_are_shown_by_their_power_and_shares_from_nothing_to_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def drawn(panels: Sequence[Panel], kinds: Sequence[str]) -> dict[str, bytes]:
        """The same panels as pixels would tell no more, and take as long."""
        assert kinds == ("svg", "png")
        return panels_files(panels, ["svg"])

    monkeypatch.setattr("analysis.power.power_report.panels_files", drawn)
    names = tuple("abcdefghijkl")
    rng = np.random.default_rng(9)
    rows = rows_of(list(rng.standard_normal((40, 6, 12)) + 9 * (np.arange(12) == 11)))
    made = findings(DESIGN, Asked(conditions=names), rows, rows[:0], ["k above l"])
    shown = [line[0] for line in lines_of_tests(made)]
    assert len(shown) == len(lines_of_estimates(made)) + 2 == 2 + 15 + 1 + 2
    assert "k - l (registered, primary)" in shown
    assert len(left_out(made)) == 66 - 15 - 1
    assert "\u22120.".encode() not in figures([made])["power.svg"]


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
    hypotheses = ("old above young between groups", "frequency by voltage", "effect of voltage")
    without = rows_of(list(null), DESIGNED)
    rows = rows_of(list(null[:60] + effect), DESIGNED)
    made = findings(DESIGN, DESIGNED, rows, without, hypotheses)
    by_name = {test.name: test for test in made.tests}
    for strong in (GROUP_SCORE, BY_GROUP, "effect of voltage"):
        assert by_name[strong].supported.value > 0.8
    assert by_name["effect of frequency"].supported.value < 0.1
    apart = by_name["high a: young - old between groups"]
    assert apart.after == (GROUP_SCORE, BY_GROUP)
    assert apart.power.value > by_name["low a: young - old between groups"].power.value
    assert not too_often(made.any_false_claim)
    # Each question on its own would have been answered wrongly far more often.
    places = [columns(DESIGNED, models=False).index(f"{name} p") for name in DESIGNED.of_design]
    assert (without[:, places] < 0.05).any(axis=1).mean() > 0.1
    first, both, _ = made.registered
    assert first.row == "young - old between groups"
    assert first.power.value > 0.9
    assert both.row == "voltage by frequency"
    assert f"80% power for '{GROUP_SCORE}', " in design_answer(made)


def test_a_group_of_which_nobody_is_left_has_no_test() -> None:
    scores = np.random.default_rng(12).normal(5, 1, (3, 8, 6))
    scores[1, 1::2] = np.nan
    scores[2] = np.nan
    rows = rows_of(list(scores), DESIGNED)
    names = columns(DESIGNED, models=False)
    known = ~np.isnan(rows[:, names.index(f"{GROUP_SCORE} p")])
    assert known.tolist() == [True, False, False]
    assert not np.isnan(rows[:2, names.index("effect of voltage p")]).any()
