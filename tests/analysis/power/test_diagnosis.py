"""What the estimators make of simulated cohorts, against the truth."""

import numpy as np
import pytest

from analysis.power.cohorts import without_effect
from analysis.power.designs import Design, designed
from analysis.power.diagnosis import columns, rows_of_cohorts, rows_of_tables
from analysis.power.drawn_cohorts import DrawnCohorts
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.statistics.many_tables import unnamed_table
from analysis.statistics.signed_rank import SignedRank, pairwise_signed_ranks
from protocol.study.rules import Exclusions
from protocol.study_file.loading import parsed_study, template


def simulated(participants: int = 9, repeats: int = 1) -> DrawnCohorts:
    paper = parsed_study(template("paper"))
    study = designed(paper, Design(participants=participants, repeats=repeats))
    return DrawnCohorts(study=study, participants=participants)


def test_a_row_has_the_numbers_of_the_report() -> None:
    simulate = simulated()
    cohort = simulate.cohort("1")
    row = dict(zip(columns(5, models=True), rows_of_cohorts([cohort])[0], strict=True))
    (first, *_) = pairwise_signed_ranks(unnamed_table(cohort.scores))
    assert isinstance(first.test, SignedRank)
    assert row["pair p 0"] == pytest.approx(first.p_holm, rel=1e-12)
    assert row["pair mean 0"] == pytest.approx(first.test.mean_difference, rel=1e-12)
    fit = ordinal_sensitivity(cohort.ratings)
    assert isinstance(fit, OrdinalSensitivity)
    gains = np.array([line.gain for line in fit.lines.subjects])
    assert row["M2 gain count"] == 9
    assert row["M2 gain error"] == pytest.approx((gains - cohort.gain).sum())
    low, high = fit.lines.subjects[0].gain_interval
    assert (0.025 <= row["M2 gain rank"] <= 0.975) == (low <= cohort.gain[0] <= high)


def test_the_tables_are_those_of_the_cohorts() -> None:
    simulate = simulated(repeats=2)
    np.testing.assert_array_equal(simulate.tables(["a"])[0], simulate.cohort("a").scores)
    assert (simulate.tables(["a"]) != simulate.tables(["b"])).any()


def test_exclusions_leave_people_out() -> None:
    simulate = simulated()
    rules = Exclusions(max_reaction_s=1.2, min_trials=3)
    study = simulate.study.model_copy(update={"exclusions": rules})
    cohort = DrawnCohorts(study=study, participants=9).cohort("1")
    assert 0 < len(cohort.ratings.subjects) < 9
    counts = np.bincount(cohort.ratings.subject)
    assert counts.min() >= 3
    tables = DrawnCohorts(study=study, participants=9).tables(["1"])
    assert np.isnan(tables[0]).all(axis=1).sum() == 9 - len(cohort.ratings.subjects)


def test_without_effect_each_subject_keeps_its_scores() -> None:
    table = simulated().tables(["1"])[0]
    table[2, 3] = np.nan
    shuffled = without_effect(table, np.random.default_rng(1))
    np.testing.assert_array_equal(np.sort(shuffled, axis=1), np.sort(table, axis=1))
    assert not np.array_equal(shuffled, table, equal_nan=True)


def test_a_cohort_that_no_model_can_fit_has_no_estimates() -> None:
    cohort = simulated(participants=2).cohort("1")
    cohort.ratings.rating[:] = 7.0
    row = dict(zip(columns(5, models=True), rows_of_cohorts([cohort])[0], strict=True))
    assert row["M2 gain count"] == 0
    assert np.isnan(row["M2 gain rank"])
    assert np.isnan(rows_of_tables([cohort.scores])[0, 0])
