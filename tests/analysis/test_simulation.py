"""Simulated cohorts: scores like the published ones, rules of exclusion, and people who leave."""

from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.loading.sessions import is_scored
from analysis.simulation import Simulation, counted_trials, responses
from analysis.trials.trial_statistics import TrialStatistics
from benchmarks.response import how_to
from device.people.person import DEFAULT, SENSITIVE, Person, Population, World
from protocol.plan.plan import arrivals, plan
from protocol.study.factor import Group
from protocol.study.rules import Exclusions
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.analysis.imported import score_table
from tests.analysis.simulated_data import score_tables, simulated_data

PUBLISHED = score_table(Path("tests/data/published_scores.csv").read_text(encoding="utf-8"))
PAPER = parsed_study(template("paper"))
EXTENDED = parsed_study(template("extended"))
NO_RULES = Exclusions()
RULES = Exclusions(
    max_false_alarms=0.4,
    max_missing_scores=0.3,
    min_reaction_s=0.4,
    max_reaction_s=2.5,
    min_trials=4,
)
# Of few changes that are noticed, too many scores would be missing.
SOME_RULES = RULES.model_copy(update={"max_missing_scores": None, "max_false_alarms": 0.7})
CARELESS = replace(
    DEFAULT,
    typical=replace(DEFAULT.typical, dropout=0.08, lapse=0.2, place_offset_m=0.001, criterion=0.1),
)
EXACT = Person(felt_noise=0.0, rating_noise=0.0, criterion=0.0, criterion_less=0.0)


def test_the_default_population_scores_as_the_people_of_table_4() -> None:
    masked: Any = np.ma  # which has no types
    found = masked.masked_invalid(score_tables(Simulation(study=PAPER), 9, *range(400)))
    means, spread = found.mean(axis=(0, 1)), found.std(axis=1, ddof=1).mean(axis=0)
    between = (found - means).mean(axis=2).std(axis=1, ddof=1).mean()
    scores = PUBLISHED.scores
    assert means.tolist() == pytest.approx(scores.mean(axis=0).tolist(), abs=0.15)
    assert (found == 10).mean() == pytest.approx((scores == 10).mean(), abs=0.03)
    assert between == pytest.approx(scores.mean(axis=1).std(ddof=1), abs=0.1)
    assert spread.tolist() == pytest.approx(scores.std(axis=0, ddof=1).tolist(), abs=0.35)


def test_the_people_of_the_demo_leave_almost_no_score_missing() -> None:
    simulation = Simulation(study=PAPER, population=SENSITIVE)
    tables = score_tables(simulation, 9, *range(200))
    assert np.isnan(tables).mean() < 0.04
    means = np.nanmean(tables, axis=(0, 1))
    assert means == pytest.approx(PUBLISHED.scores.mean(axis=0), abs=0.5)


@pytest.mark.parametrize("study", [PAPER, EXTENDED], ids=["paper", "extended"])
def test_a_table_is_that_of_the_loaded_study(study: Study) -> None:
    simulation = Simulation(study=study)
    seeds: list[int | str] = [3, "a spawn key"]
    tables = score_tables(simulation, 6, *seeds)
    for table, seed in zip(tables, seeds, strict=True):
        loaded = simulated_data(simulation, 6, seed).table
        whole = {f"P{row + 1:02d}": scores for row, scores in enumerate(table)}
        kept = np.array([whole[name] for name in loaded.subjects])
        assert np.array_equal(loaded.scores, kept, equal_nan=True)
        out = [scores for name, scores in whole.items() if name not in loaded.subjects]
        assert np.isnan(out).all()


def test_a_cohort_is_the_same_alone_and_among_others() -> None:
    simulation = Simulation(study=PAPER)
    among = score_tables(simulation, 9, *range(5))
    assert np.array_equal(among[3:4], score_tables(simulation, 9, 3), equal_nan=True)
    assert not np.array_equal(among[3], among[4], equal_nan=True)


@pytest.mark.parametrize(
    ("rules", "person"),
    [
        ({"max_false_alarms": 0.4}, replace(EXACT, felt_noise=0.1, criterion=0.1)),
        ({"max_missing_scores": 0.4}, replace(EXACT, dropout=0.05)),
        ({"min_reaction_s": 1.0}, EXACT),
        ({"max_reaction_s": 1.0, "min_trials": 12}, EXACT),
    ],
)
def test_the_rules_leave_out_whom_the_report_leaves_out(
    rules: dict[str, float], person: Person
) -> None:
    exclusions = EXTENDED.exclusions.model_copy(
        update={"max_false_alarms": None, "max_missing_scores": None, **rules}
    )
    study = EXTENDED.model_copy(update={"exclusions": exclusions})
    varied = {"reaction_median_s": DEFAULT.varied["reaction_median_s"]}
    people = Population(typical=person, varied=varied)
    simulation = Simulation(study=study, population=people)
    (table,), data = score_tables(simulation, 8, 1), simulated_data(simulation, 8, 1)
    assert data.left_out
    rows = [int(name[1:]) - 1 for name in data.table.subjects]
    assert np.array_equal(table[rows], data.table.scores, equal_nan=True)
    assert np.isnan(np.delete(table, rows, axis=0)).all()


def test_people_who_leave_are_unfinished_and_keep_what_they_answered() -> None:
    simulation = Simulation(study=PAPER, population=Population(typical=Person(dropout=0.1)))
    data = simulated_data(simulation, 20, 1)
    answers = data.trials.groupby("participant")["trial_index"].agg(["max", "count"])
    assert (answers["count"] == answers["max"] + 1).all(), "nothing after they left"
    assert set(answers.index[answers["count"] < 7]) == set(data.unfinished)
    assert 4 < len(data.unfinished) < 16


def test_the_world_may_differ_from_the_analysis() -> None:
    exact = Population(typical=replace(EXACT, gain=10.0, bias=1.0))
    worlds = (World(), World(law="coulomb"), World(rung="mode"), World(damping_ratio=0.02))
    scores = [
        score_tables(Simulation(study=PAPER, population=exact, world=world), 1, 1)[0, 0].tolist()
        for world in worlds
    ]
    assert len({tuple(each) for each in scores}) == len(worlds), scores


def test_the_truth_is_loaded_with_the_scores() -> None:
    data = simulated_data(Simulation(study=PAPER, world=World(law="coulomb")), 3, 1)
    assert {truth.law for truth in data.virtual.values()} == {"coulomb"}
    assert len({truth.gain for truth in data.virtual.values()}) == 3


def test_touches_are_judged_by_the_force_that_was_pressed() -> None:
    hard = Population(typical=Person(force_factor=1.2, force_error=0.05))
    forces = simulated_data(Simulation(study=PAPER, population=hard), 9, 1).touches["force_n"]
    planned = simulated_data(Simulation(study=PAPER, population=Population()), 9, 1).touches[
        "force_n"
    ]
    ratio = (forces / planned).to_numpy()
    assert ratio.mean() == pytest.approx(1.2, rel=0.02)
    assert ratio.std() == pytest.approx(0.06, rel=0.2)


def test_each_group_has_the_orders_that_its_participants_will_have() -> None:
    groups = tuple(Group(name=name, size=4) for name in ("young", "old"))
    study = PAPER.model_copy(update={"group": groups})
    data = simulated_data(Simulation(study=study), 8, 1)
    assert sorted(data.groups.values()) == ["old"] * 4 + ["young"] * 4
    assert sorted(order.slot for order in data.orders) == [0, 0, 1, 1, 2, 2, 3, 3]
    places = islice(arrivals(study, "participant"), 8)
    expected = [plan(study.of_group(name), slot).trials for name, slot in places]
    planned = [Simulation(study=study).planned.plan(number).trials for number in range(8)]
    assert planned == expected


def test_people_of_a_group_come_from_its_population() -> None:
    groups = tuple(Group(name=name, size=4) for name in ("young", "old"))
    study = PAPER.model_copy(update={"group": groups})
    numb = Population(typical=replace(DEFAULT.typical, gain=0.5), varied={})
    people = replace(DEFAULT, groups={"old": numb})
    data = simulated_data(Simulation(study=study, population=people), 8, 1)
    whole = simulated_data(Simulation(study=study, population=DEFAULT), 8, 1)
    for name, group in data.groups.items():
        alike = data.virtual[name].gain == whole.virtual[name].gain
        assert alike == (group == "young")
        assert (data.virtual[name].gain == 0.5) == (group == "old")


@pytest.mark.parametrize("score_when", ["agrees", "noticed", "always"])
@pytest.mark.parametrize("people", [DEFAULT, CARELESS])
@pytest.mark.parametrize(
    ("name", "rules"),
    [("paper", NO_RULES), ("extended", RULES), ("factorial", SOME_RULES)],
)
def test_responses_are_those_that_a_report_makes_of_the_trials(
    name: str, rules: Exclusions, people: Population, score_when: str
) -> None:
    text = how_to() if name == "factorial" else template(name)
    study = parsed_study(text).model_copy(update={"exclusions": rules})
    design = study.design.model_copy(update={"sessions": 2})
    rating = study.rating.model_copy(update={"score_when": score_when, "minimum": -3})
    study = study.model_copy(update={"design": design, "rating": rating})
    simulation = Simulation(study=study, population=people)
    tables, everybody = simulation.studies(12, "a")
    data = simulated_data(simulation, 12, "a")
    trials = TrialStatistics(data=data, study=study)
    rows = [int(who[1:]) - 1 for who in data.table.subjects]
    left_out = np.delete(np.arange(12), rows)
    table = tables.responses[0]
    np.testing.assert_allclose(table[rows], trials.response_tests.table.scores, rtol=1e-12)
    assert np.isnan(table[left_out]).all()
    crossed = trials.crossed
    assert crossed is not None
    over, wide = crossed
    assert wide is not None
    apart = tables.by_session[0][rows]
    np.testing.assert_allclose(table[rows].ravel(), over.responses.ravel(), rtol=1e-12)
    np.testing.assert_allclose(apart.ravel(), wide.responses.ravel(), rtol=1e-12)
    # Trial by trial, of those who answered.
    answered = responses(simulation.planned, everybody)
    counted, *_ = counted_trials(simulation.planned, everybody)
    for who, row in zip(data.table.subjects, rows, strict=True):
        own = trials.responses[(data.trials["participant"] == who) & is_scored(data.trials)]
        np.testing.assert_array_equal(answered[row, counted[row]], own[~np.isnan(own)])
    assert (answered == 0).any()
    assert (answered > 0).any()
