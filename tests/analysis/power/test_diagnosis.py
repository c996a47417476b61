"""What the estimators make of simulated cohorts, against the truth."""

from pathlib import Path

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.power.diagnosis import (
    BY_GROUP,
    ESTIMATES,
    GROUP_SCORE,
    asked_by,
    columns,
    estimates_of_cohorts,
    rows_of_tables,
)
from analysis.power.job import Design, designed
from analysis.power.people_cohorts import PeopleCohorts, RatedCohort, without_effect
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.simulation import Simulation
from analysis.statistics.detection import Detection
from analysis.statistics.factorial import Effect
from analysis.statistics.groups import Compared, GroupInteraction, group_statistics
from analysis.statistics.many_tables import unnamed_table
from analysis.statistics.signed_rank import SignedRank, pairwise_signed_ranks
from analysis.trials.trial_statistics import TrialStatistics
from protocol.registration.registration import NOTICED, OMNIBUS, effect_of
from protocol.study.factor import Group
from protocol.study.rules import Exclusions
from protocol.study_file.loading import parsed_study, template
from tests.analysis.simulated_data import simulated_data


def simulated(participants: int = 9, repeats: int = 1) -> PeopleCohorts:
    paper = parsed_study(template("paper"))
    study = designed(paper, Design(participants=participants, repeats=repeats))
    return PeopleCohorts(study=study, participants=participants)


def estimated(cohort: RatedCohort) -> dict[str, float]:
    """What the models estimate of a cohort, by the names of its columns."""
    row = estimates_of_cohorts([cohort])[0]
    names = columns(asked_by(parsed_study(template("paper"))), models=True)
    assert names[-len(row)].startswith(ESTIMATES[0])
    return dict(zip(names[-len(row) :], row, strict=True))


def row_of(made: PeopleCohorts, key: str = "1") -> dict[str, float]:
    """The tests of a cohort by the names of their columns."""
    asked = asked_by(made.study)
    (row,) = rows_of_tables(made.tables([key]), asked)
    return dict(zip(columns(asked, models=False), row, strict=True))


def scores_of(made: PeopleCohorts, key: str) -> FloatArray:
    """The table of scores as a report makes it of the trials."""
    given = made.cohort(key).ratings.given
    table = np.full((len(given.subjects), len(given.conditions)), np.nan)
    for place in np.ndindex(*table.shape):
        cell = (given.subject == place[0]) & (given.condition == place[1])
        if cell.any():
            table[place] = given.rating[cell].mean()
    return table


def test_a_row_has_the_numbers_of_the_report() -> None:
    made = simulated(repeats=2)
    cohort, row = made.cohort("1"), row_of(made)
    (first, *_) = pairwise_signed_ranks(unnamed_table(scores_of(made, "1")))
    assert isinstance(first.test, SignedRank)
    pair = made.study.conditions[:2]
    assert row[f"{' - '.join(pair)} p"] == pytest.approx(first.p_holm, rel=1e-12)
    assert row[f"{' - '.join(pair)} shift"] == pytest.approx(first.test.mean_difference, rel=1e-12)
    fit, row = ordinal_sensitivity(cohort.ratings), estimated(cohort)
    assert isinstance(fit, OrdinalSensitivity)
    gains = np.array([line.gain for line in fit.lines.subjects])
    assert row["M2 gain count"] == len(gains)
    assert row["M2 gain error"] == pytest.approx((gains - cohort.gain).sum())
    low, high = fit.lines.subjects[0].gain_interval
    assert (0.025 <= row["M2 gain rank"] <= 0.975) == (low <= cohort.gain[0] <= high)


def test_the_tables_are_those_of_the_cohorts() -> None:
    simulate = simulated(repeats=2)
    tables = simulate.tables(["a", "b"]).scores
    np.testing.assert_allclose(tables[0], scores_of(simulate, "a"), rtol=1e-12)
    assert (tables[0] != tables[1]).any()


def test_exclusions_leave_people_out() -> None:
    study = simulated().study.model_copy(update={"exclusions": Exclusions(min_trials=5)})
    strict = PeopleCohorts(study=study, participants=9)
    scores, table = scores_of(strict, "3"), strict.tables(["3"]).scores[0]
    assert len(scores) == 9
    np.testing.assert_allclose(scores, table, rtol=1e-12)
    late = study.model_copy(update={"exclusions": Exclusions(max_reaction_s=1.0, min_trials=3)})
    strict = PeopleCohorts(study=late, participants=9)
    left, table = scores_of(strict, "3"), strict.tables(["3"]).scores[0]
    assert 0 < len(left) < 9
    np.testing.assert_allclose(left, table[~np.isnan(table).all(axis=1)], rtol=1e-12)


def test_rules_that_leave_nobody_leave_nothing_to_estimate() -> None:
    rules = Exclusions(max_reaction_s=0.1, min_trials=5)
    study = simulated().study.model_copy(update={"exclusions": rules})
    made = PeopleCohorts(study=study, participants=4)
    assert estimated(made.cohort("1"))["M2 gain count"] == 0
    assert np.isnan(row_of(made)[f"{OMNIBUS} p"])


def test_without_effect_each_subject_keeps_scores_and_reports() -> None:
    study = parsed_study(template("extended"))
    design = study.design.model_copy(update={"sessions": 2})
    groups = tuple(Group(name=name, size=3) for name in ("young", "old"))
    rating = study.rating.model_copy(update={"score_when": "always"})
    study = study.model_copy(update={"design": design, "group": groups, "rating": rating})
    made = PeopleCohorts(study=study, participants=6).tables(["1", "2"])
    made.scores[0, 2, 3] = np.nan
    drawn = without_effect(made, map(np.random.default_rng, (1, 2)))
    np.testing.assert_array_equal(np.sort(drawn.scores, axis=2), np.sort(made.scores, axis=2))
    assert not np.array_equal(drawn.scores, made.scores, equal_nan=True)
    # The scores of a condition's sessions go together, and may change places.
    np.testing.assert_allclose(drawn.by_session[1].mean(axis=2), drawn.scores[1], rtol=1e-12)
    assert (np.sort(drawn.groups) == [0, 0, 0, 1, 1, 1]).all()
    assert (drawn.groups != made.groups).any()
    np.testing.assert_array_equal(drawn.noticed[..., 1], made.noticed[..., 1])
    reports = [each.noticed[..., 0].sum(axis=2) for each in (drawn, made)]
    np.testing.assert_array_equal(*reports)
    assert (drawn.noticed[..., 0] <= drawn.noticed[..., 1]).all()
    assert (drawn.noticed != made.noticed).any()


def test_what_is_noticed_is_tested_as_in_the_report() -> None:
    study = designed(parsed_study(template("extended")), Design(participants=6, repeats=4))
    made = PeopleCohorts(study=study, participants=6)
    row = row_of(made)
    trials = TrialStatistics(data=simulated_data(Simulation(study=study), 6, "1"), study=study)
    *conditions, whole = trials.noticed
    assert isinstance(whole.found, Detection)
    assert row[f"{NOTICED} p"] == pytest.approx(whole.found.p, rel=1e-9)
    in_report = {each.of["condition"]: each.p_holm for each in conditions}
    for name in study.conditions:
        assert row[f"{name} {NOTICED} p"] == pytest.approx(in_report[name])
    # Without catch trials there is no such test.
    assert np.isnan([p for name, p in row_of(simulated()).items() if NOTICED in name]).all()


def test_groups_factors_and_sessions_are_tested_as_in_the_report() -> None:
    text = Path("docs/how-to/factorial.md").read_text().split("```toml", 1)[1]
    text = text.partition("\n")[2].partition("```")[0]
    study = parsed_study(text.replace('"noticed"\n\n', '"always"\n\n', 1))
    row = row_of(PeopleCohorts(study=study, participants=12))
    data = simulated_data(Simulation(study=study), 12, "1")
    of = np.array([study.groups.index(data.groups[who]) for who in data.table.subjects])
    made = group_statistics(
        data.table.scores, np.zeros(12), of, study.groups, data.table.conditions
    )
    assert isinstance(made.score, Compared)
    assert isinstance(made.interaction, GroupInteraction)
    assert row[f"{GROUP_SCORE} p"] == pytest.approx(made.score.p)
    assert row["young - old between groups shift"] == pytest.approx(made.score.pairs[0].shift)
    assert row[f"{BY_GROUP} p"] == pytest.approx(made.interaction.p)
    cell = study.conditions[0]
    in_cell = made.conditions[cell]
    assert isinstance(in_cell, Compared)
    assert row[f"{cell}: young - old between groups p"] == pytest.approx(in_cell.pairs[0].p_holm)
    reported = TrialStatistics(data=data, study=study).factorial
    assert reported is not None
    for it in reported.effects:
        assert isinstance(it.effect, Effect)
        p = row[f"{effect_of(*it.factors)} p"]
        assert (p < 0.05) == (it.effect.p < 0.05)
        assert it.effect.p_f <= p <= it.effect.p + 0.05


def test_a_cohort_that_no_model_can_fit_has_no_estimates() -> None:
    cohort = simulated(participants=2).cohort("1")
    cohort.ratings.rating[:] = np.where(np.isnan(cohort.ratings.rating), np.nan, 7.0)
    row = estimated(cohort)
    assert row["M2 gain count"] == 0
    assert np.isnan(row["M2 gain rank"])
