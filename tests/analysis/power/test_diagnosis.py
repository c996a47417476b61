"""What the estimators make of simulated cohorts, against the truth."""

import numpy as np
import pytest

from analysis.power.diagnosis import columns, rows_of_cohorts, rows_of_tables
from analysis.power.job import Design, designed
from analysis.power.people_cohorts import PeopleCohorts, without_effect, without_noticing
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.simulation.simulation import Simulation
from analysis.statistics.detection import Detection
from analysis.statistics.many_tables import unnamed_table
from analysis.statistics.signed_rank import SignedRank, pairwise_signed_ranks
from analysis.trials.trial_statistics import TrialStatistics
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
    tables, noticed = simulate.tables(["a"])
    np.testing.assert_allclose(tables[0], simulate.cohort("a").scores, rtol=1e-12)
    np.testing.assert_array_equal(noticed[0], simulate.cohort("a").noticed)
    assert (simulate.tables(["a"])[0] != simulate.tables(["b"])[0]).any()


def test_exclusions_leave_people_out() -> None:
    study = simulated().study.model_copy(update={"exclusions": Exclusions(min_trials=5)})
    strict = PeopleCohorts(study=study, participants=9)
    scores, table = strict.cohort("3").scores, strict.tables(["3"])[0][0]
    assert len(scores) == 9
    np.testing.assert_allclose(scores, table, rtol=1e-12)
    late = study.model_copy(update={"exclusions": Exclusions(max_reaction_s=1.0, min_trials=3)})
    strict = PeopleCohorts(study=late, participants=9)
    left, table = strict.cohort("3").scores, strict.tables(["3"])[0][0]
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
    table = simulated().tables(["1"])[0][0]
    table[2, 3] = np.nan
    shuffled = without_effect(table, np.random.default_rng(1))
    np.testing.assert_array_equal(np.sort(shuffled, axis=1), np.sort(table, axis=1))
    assert not np.array_equal(shuffled, table, equal_nan=True)


def test_what_is_noticed_is_tested_as_in_the_report() -> None:
    study = designed(parsed_study(template("extended")), Design(participants=6, repeats=4))
    made = PeopleCohorts(study=study, participants=6)
    tables, noticed = made.tables(["1"])
    row = dict(zip(columns(5, models=False), rows_of_tables([*tables], [*noticed])[0], strict=True))
    trials = TrialStatistics(data=Simulation(study=study).data(6, "1"), study=study)
    *conditions, whole = trials.noticed
    assert isinstance(whole.found, Detection)
    assert row["noticed p"] == pytest.approx(whole.found.p, rel=1e-9)
    in_report = {each.of["condition"]: each.p_holm for each in conditions}
    for place, name in enumerate(study.conditions):
        assert row[f"noticed p {place}"] == pytest.approx(in_report[name])
    # Without catch trials there is no such test.
    (paper,), (counts,) = simulated().tables(["1"])
    assert np.isnan(rows_of_tables([paper], [counts])[0, -6:]).all()


def test_without_noticing_each_person_reports_as_often_as_before() -> None:
    study = parsed_study(template("extended"))
    _, (counts,) = PeopleCohorts(study=study, participants=6).tables(["1"])
    drawn = without_noticing(counts, np.random.default_rng(1))
    np.testing.assert_array_equal(drawn[..., 1], counts[..., 1])
    np.testing.assert_array_equal(drawn[..., 0].sum(axis=1), counts[..., 0].sum(axis=1))
    assert (drawn[..., 0] <= drawn[..., 1]).all()
    assert (drawn != counts).any()


def test_a_cohort_that_no_model_can_fit_has_no_estimates() -> None:
    cohort = simulated(participants=2).cohort("1")
    cohort.ratings.rating[:] = np.where(np.isnan(cohort.ratings.rating), np.nan, 7.0)
    row = dict(zip(columns(5, models=True), rows_of_cohorts([cohort])[0], strict=True))
    assert row["M2 gain count"] == 0
    assert np.isnan(row["M2 gain rank"])
    assert np.isnan(rows_of_tables([cohort.scores])[0, 0])
