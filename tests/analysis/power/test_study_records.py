"""What the estimators make of simulated cohorts, against the truth."""

import numpy as np
import pytest

from analysis.estimates import Estimate, NotEstimable
from analysis.power.answered_cohorts import AnsweredCohort, AnsweredCohorts
from analysis.power.designs import Design, designed
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.study_records import (
    BY_GROUP,
    GROUP_GAIN,
    GROUP_SCORE,
    LEVELS,
    MEAN_GAIN,
    Asked,
    Record,
    asked_by,
    record_of_answers,
    record_of_tables,
)
from analysis.sensitivity.answers_model import Rated, sensitivity
from analysis.simulation import Simulation
from analysis.statistics.detection import Detection
from analysis.statistics.factorial import Effect
from analysis.statistics.groups import Compared, GroupInteraction, group_statistics
from analysis.statistics.omnibus import omnibus_p
from analysis.statistics.signed_rank import SignedRank
from analysis.statistics.slope import Slope, slope
from analysis.trials.trial_statistics import TrialStatistics
from benchmarks.response import how_to
from device.friction.calibration import Calibration
from device.friction.surfaces import GivenSurface
from protocol.registration.registration import FOLLOWS, GAINS, NOTICED, OMNIBUS, effect_of
from protocol.study.rules import Exclusions
from protocol.study_file.loading import parsed_study, template
from tests.analysis.simulated_data import simulated_data


def simulated(participants: int = 9, repeats: int = 1) -> PeopleCohorts:
    paper = parsed_study(template("paper"))
    study = designed(paper, Design(participants=participants, repeats=repeats))
    return PeopleCohorts(study=study, participants=participants)


def cohort_of(made: PeopleCohorts, key: str) -> AnsweredCohort:
    return AnsweredCohorts(cohorts=made).cohort(key)


def record_of(made: PeopleCohorts) -> Record:
    """The tests of a cohort."""
    (tables,) = zip(*made.simulation.studies(made.participants, "1")[0], strict=True)
    return record_of_tables(asked_by(made.study), *tables)


def test_what_is_asked_follows_from_the_study() -> None:
    alone, threshold = Asked(), asked_by(parsed_study(template("threshold")), models=True)
    assert (alone.tests, alone.estimates, threshold.conditions) == ([], [], ())
    assert threshold.estimates[0] == "threshold of smallest amplitude, dB"
    study = parsed_study(template("paper"))
    paper = asked_by(study, models=True)
    questions = [name for name, after in paper.family.items() if not after]
    assert questions == [OMNIBUS, FOLLOWS, NOTICED]
    assert GAINS in paper.tests
    assert GAINS not in asked_by(study).tests, "no model is fitted"
    assert paper.estimates == [MEAN_GAIN, LEVELS] == ["group's gain", "levels"]
    # Two conditions have no more than two orders.
    two = study.model_copy(update={"condition": study.condition[:2]})
    assert FOLLOWS not in asked_by(two).tests
    surface = study.surface.model_copy(update={"kind": "given", "length_m": 0.1})
    given = study.model_copy(update={"surface": surface})
    without = asked_by(given, Calibration.of(GivenSurface(length_m=0.1)), models=True)
    assert without.estimates == [], "nothing is predicted"
    assert GAINS not in without.tests


def test_a_record_has_the_numbers_of_the_report() -> None:
    made = simulated(repeats=2)
    tests = record_of(made).tests
    study = made.study
    trials = TrialStatistics(data=simulated_data(Simulation(study=study), 9, "1"), study=study)
    (first, *_) = trials.response_tests.pairwise
    assert isinstance(first.test, SignedRank)
    pair = " - ".join(study.conditions[:2])
    assert tests[pair] == pytest.approx(first.p_holm, rel=1e-12)
    # The rule of thumb of a simulated study where the report's p is exact.
    assert tests[OMNIBUS] == pytest.approx(omnibus_p(trials.response_tests.table))
    # A report has contrasts of fingers as measured, which come in the same order.
    assert isinstance(trials.slope, Slope)
    assert tests[FOLLOWS] == pytest.approx(trials.slope.p, abs=0.02)
    as_planned = slope(trials.response_tests.table.scores, np.array(asked_by(study).contrasts))
    assert isinstance(as_planned, Slope)
    assert tests[FOLLOWS] == as_planned.p


def test_estimates_are_those_of_the_model_of_the_answers() -> None:
    cohort = cohort_of(simulated(repeats=4), "1")
    tests, estimates, told = record_of_answers(cohort, 3.0)
    rated = sensitivity(cohort.answers).rating
    assert isinstance(rated, Rated)
    assert tests == {GAINS: pytest.approx(rated.equal_gains)}
    assert told == (rated.untold is None)
    names = cohort.answers.ratings.subjects
    rows = [names.index(person.subject) for person in rated.subjects]
    truth = (cohort.lines.bias + rated.contrast * cohort.lines.gain)[rows]
    levels = np.array([person.level.value for person in rated.subjects])
    low, high = np.transpose([person.level.interval for person in rated.subjects])
    number, error, squared, covered, width = estimates[LEVELS]
    assert number == len(levels)
    assert error == pytest.approx((levels - truth).sum())
    assert squared == pytest.approx(((levels - truth) ** 2).sum())
    assert covered == ((low <= truth) & (truth <= high)).sum() > 0
    assert width == pytest.approx((high - low).sum())
    assert isinstance(rated.gain, Estimate)
    group = estimates[MEAN_GAIN]
    assert group.number == 1
    assert group.error == pytest.approx(rated.gain.value - 3.0)


def test_rules_that_leave_nobody_leave_nothing_to_estimate() -> None:
    rules = Exclusions(max_reaction_s=0.1, min_trials=5)
    study = simulated().study.model_copy(update={"exclusions": rules})
    made = PeopleCohorts(study=study, participants=4)
    assert record_of_answers(cohort_of(made, "1"), 3.0) == ({}, {}, 0.0)
    assert record_of(made).tests == {}


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
    cohort.answers.ratings.rating[:] = np.where(
        np.isnan(cohort.answers.ratings.rating), np.nan, 7.0
    )
    assert record_of_answers(cohort, 3.0) == ({}, {}, 0.0)


def test_a_single_person_with_ratings_has_a_level_and_tells_nothing_of_a_group() -> None:
    cohort = cohort_of(simulated(repeats=4), "1")
    ratings = cohort.answers.ratings
    ratings.rating[ratings.subject > 0] = np.nan
    tests, estimates, told = record_of_answers(cohort, 3.0)
    assert (tests, list(estimates), told) == ({}, [LEVELS], 0.0)
    assert estimates[LEVELS].number == 1
