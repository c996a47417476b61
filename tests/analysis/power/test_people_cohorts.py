"""Simulated cohorts as arrays are those that a report makes of the same sessions."""

from dataclasses import fields, replace

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.loading.sessions import is_scored
from analysis.loading.study_data import NothingToReport
from analysis.power.people_cohorts import PeopleCohorts
from analysis.simulation import Simulation, counted_trials, responses
from analysis.trials.contrasts import scored_trials, trial_contrasts
from analysis.trials.trial_statistics import TrialStatistics
from benchmarks.response import how_to
from device.friction.calibration import Calibration
from device.people.person import DEFAULT, Population, World
from protocol.study.rules import Exclusions
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.analysis.simulated_data import simulated_data

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
RIG = Calibration(damping_ratio=0.007, gain=0.8, body_height_m=2e-5, origin="a test")


@pytest.mark.parametrize(("name", "sessions"), [("paper", 1), ("extended", 1), ("extended", 3)])
@pytest.mark.parametrize("people", [DEFAULT, CARELESS])
@pytest.mark.parametrize("rules", [NO_RULES, RULES])
def test_a_cohort_is_what_a_report_makes_of_its_sessions(
    name: str, sessions: int, people: Population, rules: Exclusions
) -> None:
    study = parsed_study(template(name)).model_copy(update={"exclusions": rules})
    design = study.design.model_copy(update={"sessions": sessions})
    study = study.model_copy(update={"design": design})
    made = PeopleCohorts(study=study, participants=6, population=people, rig=RIG)
    for key in ("a", "b"):
        (found,) = made.studies([key])[1]
        names, arrays, truths = _as_reported(study, people, key)
        assert found.ratings.subjects == names
        assert found.ratings.conditions == study.conditions
        for entry, expected in arrays.items():
            np.testing.assert_array_equal(getattr(found.ratings, entry), expected)
        np.testing.assert_array_equal(found.gain, truths)


def test_people_feel_a_drive_in_hz_as_far_from_the_resonance_as_on_the_rig() -> None:
    written = template("paper")
    nominal_hz = parsed_study(written).rig.nominal_resonance_hz
    in_hz = written
    for share in (0.98, 1.0):
        in_hz = in_hz.replace(f"frequency = {share}", f"frequency_hz = {share * nominal_hz!r}")
    assert in_hz.count(", frequency_hz = ") == 2
    felt = [
        PeopleCohorts(study=parsed_study(text), participants=6, population=DEFAULT, rig=RIG)
        for text in (written, in_hz)
    ]
    relative, hertz = (next(cohorts.studies(["a"])[1]).ratings for cohorts in felt)
    np.testing.assert_array_equal(relative.rating, hertz.rating)
    np.testing.assert_allclose(relative.contrast, hertz.contrast)


def _as_reported(
    study: Study, people: Population, key: str
) -> tuple[tuple[str, ...], dict[str, FloatArray], FloatArray]:
    """Return subjects, the arrays of their trials, and their true gains, by way of the tables."""
    world = World(damping_ratio=RIG.damping_ratio, gain=RIG.gain)
    try:
        data = simulated_data(Simulation(study=study, population=people, world=world), 6, key)
    except NothingToReport:
        return (), {}, np.zeros(0)
    contrasts = trial_contrasts(study, data.trials, data.touches, RIG)
    ratings = scored_trials(data, contrasts).ratings
    arrays = {
        entry.name: getattr(ratings, entry.name)
        for entry in fields(ratings)
        if entry.name not in {"subjects", "conditions"}
    }
    truths = [data.virtual[name] for name in data.table.subjects]
    return data.table.subjects, arrays, np.array([each.gain * each.skin for each in truths])


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
