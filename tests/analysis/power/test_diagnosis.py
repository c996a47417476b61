"""What the estimators make of simulated cohorts, against the truth."""

import numpy as np
import pytest

from analysis.power.diagnosis import columns, rows_of_cohorts, rows_of_tables
from analysis.power.job import Design, designed
from analysis.power.people_cohorts import PeopleCohorts, without_effect
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.statistics.many_tables import unnamed_table
from analysis.statistics.signed_rank import SignedRank, pairwise_signed_ranks
from protocol.study.rules import Exclusions
from protocol.study_file.loading import parsed_study, template


def simulated(participants: int = 9, repeats: int = 1) -> PeopleCohorts:
    paper = parsed_study(template("paper"))
    study = designed(paper, Design(participants=participants, repeats=repeats))
    return PeopleCohorts(study=study, participants=participants)


def test_a_row_has_the_numbers_of_the_report() -> None:
    cohort = simulated(repeats=2).cohort("1")
    row = dict(zip(columns(5, models=True), rows_of_cohorts([cohort])[0], strict=True))
    (first, *_) = pairwise_signed_ranks(unnamed_table(cohort.scores))
    assert isinstance(first.test, SignedRank)
    assert row["pair p 0"] == pytest.approx(first.p_holm, rel=1e-12)
    assert row["pair mean 0"] == pytest.approx(first.test.mean_difference, rel=1e-12)
    fit = ordinal_sensitivity(cohort.ratings)
    assert isinstance(fit, OrdinalSensitivity)
    gains = np.array([line.gain for line in fit.lines.subjects])
    assert row["M2 gain count"] == len(gains)
    assert row["M2 gain error"] == pytest.approx((gains - cohort.gain).sum())
    low, high = fit.lines.subjects[0].gain_interval
    assert (0.025 <= row["M2 gain rank"] <= 0.975) == (low <= cohort.gain[0] <= high)


def test_the_tables_are_those_of_the_cohorts() -> None:
    simulate = simulated(repeats=2)
    np.testing.assert_allclose(simulate.tables(["a"])[0], simulate.cohort("a").scores, rtol=1e-12)
    assert (simulate.tables(["a"]) != simulate.tables(["b"])).any()


def test_exclusions_leave_people_out() -> None:
    study = simulated().study.model_copy(update={"exclusions": Exclusions(min_trials=5)})
    strict = PeopleCohorts(study=study, participants=9)
    scores, table = strict.cohort("3").scores, strict.tables(["3"])[0]
    assert len(scores) == 9
    np.testing.assert_allclose(scores, table, rtol=1e-12)
    late = study.model_copy(update={"exclusions": Exclusions(max_reaction_s=1.0, min_trials=3)})
    strict = PeopleCohorts(study=late, participants=9)
    left, table = strict.cohort("3").scores, strict.tables(["3"])[0]
    assert 0 < len(left) < 9
    np.testing.assert_allclose(left, table[~np.isnan(table).all(axis=1)], rtol=1e-12)


def test_rules_that_leave_nobody_leave_nothing_to_estimate() -> None:
    rules = Exclusions(max_reaction_s=0.1, min_trials=5)
    study = simulated().study.model_copy(update={"exclusions": rules})
    row = rows_of_cohorts([PeopleCohorts(study=study, participants=4).cohort("1")])[0]
    found = dict(zip(columns(5, models=True), row, strict=True))
    assert found["M2 gain count"] == 0
    assert np.isnan(found["omnibus p"])


def test_without_effect_each_subject_keeps_its_scores() -> None:
    table = simulated().tables(["1"])[0]
    table[2, 3] = np.nan
    shuffled = without_effect(table, np.random.default_rng(1))
    np.testing.assert_array_equal(np.sort(shuffled, axis=1), np.sort(table, axis=1))
    assert not np.array_equal(shuffled, table, equal_nan=True)


def test_a_cohort_that_no_model_can_fit_has_no_estimates() -> None:
    cohort = simulated(participants=2).cohort("1")
    cohort.ratings.rating[:] = np.where(np.isnan(cohort.ratings.rating), np.nan, 7.0)
    row = dict(zip(columns(5, models=True), rows_of_cohorts([cohort])[0], strict=True))
    assert row["M2 gain count"] == 0
    assert np.isnan(row["M2 gain rank"])
    assert np.isnan(rows_of_tables([cohort.scores])[0, 0])
