"""What the estimators make of simulated cohorts, against the truth."""

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.power.designs import Design, designed
from analysis.power.people_cohorts import PeopleCohorts, RatedCohort, without_effect
from analysis.power.study_records import (
    BY_GROUP,
    GROUP_GAIN,
    GROUP_SCORE,
    Asked,
    Record,
    asked_by,
    record_of_models,
    record_of_tables,
)
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.simulation import Simulation, Tables
from analysis.statistics.detection import Detection
from analysis.statistics.factorial import Effect
from analysis.statistics.groups import Compared, GroupInteraction, group_statistics
from analysis.statistics.omnibus import omnibus_p
from analysis.statistics.signed_rank import SignedRank
from analysis.statistics.slope import Slope, slope
from analysis.trials.trial_statistics import TrialStatistics
from benchmarks.response import how_to
from protocol.registration.registration import FOLLOWS, GAINS, NOTICED, OMNIBUS, effect_of
from protocol.study.factor import Group
from protocol.study.rules import Exclusions
from protocol.study_file.loading import parsed_study, template
from tests.analysis.simulated_data import simulated_data


def simulated(participants: int = 9, repeats: int = 1) -> PeopleCohorts:
    paper = parsed_study(template("paper"))
    study = designed(paper, Design(participants=participants, repeats=repeats))
    return PeopleCohorts(study=study, participants=participants)


def cohort_of(made: PeopleCohorts, key: str) -> RatedCohort:
    (cohort,) = made.studies([key])[1]
    return cohort


def record_of(made: PeopleCohorts) -> Record:
    """The tests and mean differences of a cohort."""
    (tables,) = zip(*made.studies(["1"])[0], strict=True)
    return record_of_tables(asked_by(made.study), *tables)


def scores_of(made: PeopleCohorts, key: str) -> FloatArray:
    """The table of scores as a report makes it of the trials."""
    given = cohort_of(made, key).ratings.given
    table = np.full((len(given.subjects), len(given.conditions)), np.nan)
    for place in np.ndindex(*table.shape):
        cell = (given.subject == place[0]) & (given.condition == place[1])
        if cell.any():
            table[place] = given.rating[cell].mean()
    return table


def test_what_is_asked_follows_from_the_study() -> None:
    alone, threshold = Asked(), asked_by(parsed_study(template("threshold")), models=True)
    assert (alone.tests, alone.estimates, threshold.conditions) == ([], [], ())
    assert threshold.estimates[0] == "threshold of smallest amplitude, dB"
    study = parsed_study(template("paper"))
    paper = asked_by(study, models=True)
    questions = [name for name, after in paper.family.items() if not after]
    assert questions == [OMNIBUS, FOLLOWS, NOTICED]
    assert GAINS in paper.tests
    assert paper.estimates[:2] == ["M2 bias", "M2 gain"]
    # Two conditions have no more than two orders.
    two = study.model_copy(update={"condition": study.condition[:2]})
    assert FOLLOWS not in asked_by(two).tests


def test_a_record_has_the_numbers_of_the_report() -> None:
    made = simulated(repeats=2)
    tests, estimates = record_of(made)
    study = made.study
    trials = TrialStatistics(data=simulated_data(Simulation(study=study), 9, "1"), study=study)
    (first, *_) = trials.response_tests.pairwise
    assert isinstance(first.test, SignedRank)
    pair = " - ".join(study.conditions[:2])
    assert tests[pair] == pytest.approx(first.p_holm, rel=1e-12)
    difference = estimates[f"mean difference {pair}"]
    assert difference.error == pytest.approx(first.test.mean_difference, rel=1e-12)
    interval = first.test.mean_difference_interval
    assert not isinstance(interval, NotEstimable)
    assert difference.width == pytest.approx(interval[1] - interval[0])
    # The rule of thumb of a simulated study where the report's p is exact.
    assert tests[OMNIBUS] == pytest.approx(omnibus_p(trials.response_tests.table))
    # A report has contrasts of fingers as measured, which come in the same order.
    assert isinstance(trials.slope, Slope)
    assert tests[FOLLOWS] == pytest.approx(trials.slope.p, abs=0.02)
    as_planned = slope(trials.response_tests.table.scores, np.array(asked_by(study).contrasts))
    assert isinstance(as_planned, Slope)
    assert tests[FOLLOWS] == as_planned.p


def test_estimates_are_those_of_the_models() -> None:
    cohort = cohort_of(simulated(repeats=2), "1")
    fit, (tests, estimates) = ordinal_sensitivity(cohort.ratings), record_of_models(cohort)
    assert isinstance(fit, OrdinalSensitivity)
    assert not tests
    gains = np.array([line.gain for line in fit.lines.subjects])
    low, high = np.transpose([line.gain_interval for line in fit.lines.subjects])
    number, error, squared, covered, width = estimates["M2 gain"]
    assert number == len(gains)
    assert error == pytest.approx((gains - cohort.gain).sum())
    assert squared == pytest.approx(((gains - cohort.gain) ** 2).sum())
    assert covered == ((low <= cohort.gain) & (cohort.gain <= high)).sum()
    assert width == pytest.approx((high - low).sum())
    group = estimates["M2 group's gain"]
    assert group.error == pytest.approx(fit.lines.gain - cohort.population_gain)


def test_the_tables_are_those_of_the_cohorts() -> None:
    simulate = simulated(repeats=2)
    tables = simulate.studies(["a", "b"])[0].scores
    np.testing.assert_allclose(tables[0], scores_of(simulate, "a"), rtol=1e-12)
    assert (tables[0] != tables[1]).any()


def test_exclusions_leave_people_out() -> None:
    study = simulated().study.model_copy(update={"exclusions": Exclusions(min_trials=5)})
    strict = PeopleCohorts(study=study, participants=9)
    scores, table = scores_of(strict, "3"), strict.studies(["3"])[0].scores[0]
    assert len(scores) == 9
    np.testing.assert_allclose(scores, table, rtol=1e-12)
    late = study.model_copy(update={"exclusions": Exclusions(max_reaction_s=1.0, min_trials=3)})
    strict = PeopleCohorts(study=late, participants=9)
    left, table = scores_of(strict, "3"), strict.studies(["3"])[0].scores[0]
    assert 0 < len(left) < 9
    np.testing.assert_allclose(left, table[~np.isnan(table).all(axis=1)], rtol=1e-12)


def test_rules_that_leave_nobody_leave_nothing_to_estimate() -> None:
    rules = Exclusions(max_reaction_s=0.1, min_trials=5)
    study = simulated().study.model_copy(update={"exclusions": rules})
    made = PeopleCohorts(study=study, participants=4)
    assert record_of_models(cohort_of(made, "1")) == ({}, {})
    assert record_of(made).tests == {}


def test_without_effect_each_subject_keeps_responses_and_reports() -> None:
    study = parsed_study(template("extended"))
    design = study.design.model_copy(update={"sessions": 2})
    groups = tuple(Group(name=name, size=3) for name in ("young", "old"))
    rating = study.rating.model_copy(update={"score_when": "always"})
    study = study.model_copy(update={"design": design, "group": groups, "rating": rating})
    made = PeopleCohorts(study=study, participants=6).studies(["1", "2"])[0]
    made.scores[0, 2, 3] = np.nan
    drawn = without_effect(made, map(np.random.default_rng, (1, 2)))
    np.testing.assert_array_equal(np.sort(drawn.responses, axis=2), np.sort(made.responses, axis=2))
    np.testing.assert_array_equal(np.sort(drawn.scores, axis=2), np.sort(made.scores, axis=2))
    assert not np.array_equal(drawn.responses, made.responses, equal_nan=True)
    # The responses and the scores of a condition go together.
    for one, other in zip(*map(_pairs, (drawn, made)), strict=True):
        assert sorted(one) == sorted(other)
    # The responses of a condition's sessions go together, and may change places.
    np.testing.assert_allclose(drawn.by_session.mean(axis=3), drawn.responses, rtol=1e-12)
    assert (drawn.by_session != made.by_session).any()
    assert (np.sort(drawn.groups) == [0, 0, 0, 1, 1, 1]).all()
    assert (drawn.groups != made.groups).any()
    np.testing.assert_array_equal(drawn.noticed[..., 1], made.noticed[..., 1])
    reports = [each.noticed[..., 0].sum(axis=2) for each in (drawn, made)]
    np.testing.assert_array_equal(*reports)
    assert (drawn.noticed[..., 0] <= drawn.noticed[..., 1]).all()
    assert (drawn.noticed != made.noticed).any()


def _pairs(tables: Tables) -> list[list[tuple[float, float]]]:
    """Responses with their scores, of each person."""
    both = np.nan_to_num(np.stack([tables.responses, tables.scores], axis=-1), nan=-1.0)
    return [[*map(tuple, of_person)] for of_person in both.reshape(-1, *both.shape[2:]).tolist()]


def test_what_is_noticed_is_tested_as_in_the_report() -> None:
    study = designed(parsed_study(template("extended")), Design(participants=6, repeats=4))
    made = PeopleCohorts(study=study, participants=6)
    tests = record_of(made).tests
    trials = TrialStatistics(data=simulated_data(Simulation(study=study), 6, "1"), study=study)
    *conditions, whole = trials.noticed
    assert isinstance(whole.found, Detection)
    assert tests[NOTICED] == pytest.approx(whole.found.p, rel=1e-9)
    in_report = {each.of["condition"]: each.p_holm for each in conditions}
    for name in study.conditions:
        assert tests[f"{name} {NOTICED}"] == pytest.approx(in_report[name])
    # Without catch trials there is no such test.
    assert not [name for name in record_of(simulated()).tests if NOTICED in name]


def test_groups_factors_and_sessions_are_tested_as_in_the_report() -> None:
    study = parsed_study(how_to())
    tests = record_of(PeopleCohorts(study=study, participants=12)).tests
    data = simulated_data(Simulation(study=study), 12, "1")
    trials = TrialStatistics(data=data, study=study)
    table, contrasts = trials.response_tests.table, asked_by(study).contrasts
    gains = np.array([np.polyfit(contrasts, row, 1)[0] for row in table.scores])
    of = np.array([study.groups.index(data.groups[who]) for who in table.subjects])
    made = group_statistics(table.scores, gains, of, study.groups, table.conditions)
    assert isinstance(made.gain, Compared)
    # On contrasts as planned, where the report's are of fingers as measured.
    assert tests[GROUP_GAIN] == pytest.approx(made.gain.p)
    assert isinstance(made.score, Compared)
    assert isinstance(made.interaction, GroupInteraction)
    assert tests[GROUP_SCORE] == pytest.approx(made.score.p)
    pair = "young - old between groups"
    assert tests[pair] == pytest.approx(made.score.pairs[0].p_holm)
    assert tests[BY_GROUP] == pytest.approx(made.interaction.p)
    cell = study.conditions[0]
    in_cell = made.conditions[cell]
    assert isinstance(in_cell, Compared)
    assert tests[f"{cell}: {pair}"] == pytest.approx(in_cell.pairs[0].p_holm)
    reported = trials.factorial
    assert reported is not None
    for it in reported.effects:
        assert isinstance(it.effect, Effect)
        p = tests[effect_of(*it.factors)]
        assert (p < 0.05) == (it.effect.p < 0.05)
        assert not isinstance(it.effect.p_f, NotEstimable)
        assert it.effect.p_f <= p <= it.effect.p + 0.05


def test_a_cohort_that_no_model_can_fit_has_no_estimates() -> None:
    cohort = cohort_of(simulated(participants=2), "1")
    cohort.ratings.rating[:] = np.where(np.isnan(cohort.ratings.rating), np.nan, 7.0)
    assert record_of_models(cohort) == ({}, {})
