"""Answers of simulated cohorts are those that a report takes, and their lines those of people."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.loading.study_data import NothingToReport
from analysis.power.answered_cohorts import AnsweredCohorts
from analysis.power.people_cohorts import PeopleCohorts
from analysis.simulation import Simulation
from analysis.trials.contrasts import trial_contrasts
from analysis.trials.study_answers import study_answers
from benchmarks.response import how_to
from device.friction.calibration import Calibration
from device.friction.changes import LAW
from device.friction.surfaces import GivenSurface
from device.people.person import DEFAULT, Person, Population, World
from protocol.study.factor import Group
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
CARELESS = replace(
    DEFAULT,
    typical=replace(DEFAULT.typical, dropout=0.08, lapse=0.2, place_offset_m=0.001, criterion=0.1),
)
RIG = Calibration(damping_ratio=0.007, gain=0.8, body_height_m=2e-5, origin="a test")
PAPER = parsed_study(template("paper"))


def with_design(study: Study, **changed: Any) -> Study:
    return study.model_copy(update={"design": study.design.model_copy(update=changed)})


def grouped(study: Study, size: int) -> Study:
    groups = tuple(Group(name=name, size=size) for name in ("young", "old"))
    return study.model_copy(update={"group": groups})


# As the report takes them.


@pytest.mark.parametrize(
    ("name", "sessions"), [("paper", 1), ("extended", 1), ("extended", 3), ("grouped", 1)]
)
@pytest.mark.parametrize("people", [DEFAULT, CARELESS])
@pytest.mark.parametrize("rules", [NO_RULES, RULES])
def test_a_cohort_is_what_a_report_makes_of_its_sessions(
    name: str, sessions: int, people: Population, rules: Exclusions
) -> None:
    study = grouped(PAPER, 3) if name == "grouped" else parsed_study(template(name))
    study = with_design(study.model_copy(update={"exclusions": rules}), sessions=sessions)
    for key in ("a", "b"):
        compare_with_a_report(study, people, key)


@pytest.mark.parametrize("score_when", ["agrees", "noticed", "always"])
def test_a_factorial_cohort_with_groups_and_sessions_is_what_a_report_makes(
    score_when: str,
) -> None:
    study = parsed_study(how_to())
    rating = study.rating.model_copy(update={"score_when": score_when, "minimum": -3})
    compare_with_a_report(study.model_copy(update={"rating": rating}), CARELESS, "a", 12)


def compare_with_a_report(
    study: Study, people: Population, key: str, participants: int = 6
) -> None:
    made = PeopleCohorts(study=study, participants=participants, population=people, rig=RIG)
    answers = AnsweredCohorts(cohorts=made).cohort(key).answers
    world = World(damping_ratio=RIG.damping_ratio, gain=RIG.gain)
    simulation = Simulation(study=study, population=people, world=world)
    try:
        data = simulated_data(simulation, participants, key)
    except NothingToReport:
        assert answers.ratings.subjects == ()
        return
    contrast = trial_contrasts(study, data.trials, data.touches, RIG).by_law[LAW]
    reported = study_answers(study, data, contrast, study.rating)
    compare(answers.ratings, reported.ratings)
    assert answers.answered is not None
    assert reported.answered is not None
    compare(answers.answered, reported.answered)
    for name in ("scale", "selects", "groups"):
        assert getattr(answers, name) == getattr(reported, name)
    for name in ("group", "session"):
        np.testing.assert_array_equal(getattr(answers, name), getattr(reported, name))


def compare(one: Any, other: Any) -> None:
    for field in fields(one):
        if field.name != "ratings":
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


def test_people_feel_a_drive_in_hz_as_far_from_the_resonance_as_on_the_rig() -> None:
    written = template("paper")
    nominal_hz = PAPER.rig.nominal_resonance_hz
    in_hz = written
    for share in (0.98, 1.0):
        in_hz = in_hz.replace(f"frequency = {share}", f"frequency_hz = {share * nominal_hz!r}")
    assert in_hz.count(", frequency_hz = ") == 2
    relative, hertz = (
        AnsweredCohorts(cohorts=PeopleCohorts(study=parsed_study(text), participants=6, rig=RIG))
        .cohort("a")
        .answers.ratings
        for text in (written, in_hz)
    )
    np.testing.assert_array_equal(relative.rating, hertz.rating)
    np.testing.assert_allclose(relative.contrast, hertz.contrast)


# The lines that people follow, against what they score again and again. Their noise of scoring
# makes whole numbers of scores without a bias.

SURE = Person(bias=4.0, gain=5.0, felt_noise=0.0, criterion=-10.0, speed_error=0.05, skin=0.7)
PEOPLE = 300


def scored(study: Study, person: Person, **groups: Population) -> tuple[AnsweredCohorts, Any]:
    people = Population(typical=person, groups=groups)
    cohorts = AnsweredCohorts(
        cohorts=PeopleCohorts(study=study, participants=PEOPLE, population=people)
    )
    return cohorts, cohorts.cohort("again and again")


def own_lines(made: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each person's mean score, mean contrast, and slope of scores on contrasts."""
    ratings, rows = made.answers.rated, []
    for who in range(len(ratings.subjects)):
        own = (ratings.subject == who) & ~np.isnan(ratings.rating)
        contrast, rating = ratings.contrast[own], ratings.rating[own]
        rows.append((rating.mean(), contrast.mean(), np.polyfit(contrast, rating, 1)[0]))
    level, x, slope = np.transpose(rows)
    return level, x, slope


def agrees(errors: FloatArray, most: float) -> bool:
    """Whether errors are 0 on average, known to within a quarter of `most`."""
    error = errors.std(ddof=1) / np.sqrt(len(errors))
    assert 4 * error < most, error
    return bool(abs(errors.mean()) < 4 * error)


ALWAYS = PAPER.model_copy(
    update={"rating": PAPER.rating.model_copy(update={"score_when": "always"})}
)


@pytest.mark.parametrize(("low", "high"), [(0, 10), (-50, 150)])
def test_a_line_is_that_of_many_scores(low: int, high: int) -> None:
    rating = ALWAYS.rating.model_copy(update={"minimum": low, "maximum": high, "bands": ()})
    study = with_design(ALWAYS.model_copy(update={"rating": rating}), repeats=4)
    _, made = scored(study, SURE)
    unit = (high - low) / 10
    level, x, slope = own_lines(made)
    assert agrees(slope - made.lines.gain, 1.0 * unit)
    assert agrees(level - made.lines.bias - made.lines.gain * x, 0.15 * unit)
    # Neither the person's own nor their product with the skin's share of a change.
    assert abs(made.lines.gain.mean() / unit - 5.0 * 0.7) > 0.15
    assert made.lines.bias.std() < 0.3 * unit


def test_a_bias_has_what_the_kinds_of_change_add_and_the_drift_of_a_session() -> None:
    person = replace(SURE, beyond_swing=0.5, beyond_strength=1.5, beyond_ramp=2.0, drift=0.05)
    _, made = scored(with_design(ALWAYS, sessions=3), person)
    level, x, _ = own_lines(made)
    assert agrees(level - made.lines.bias - made.lines.gain * x, 0.15)


def test_the_population_s_line_is_the_mean_over_groups() -> None:
    steep = Population(typical=replace(SURE, gain=8.0, bias=3.0))
    groups = (Group(name="young", size=PEOPLE // 3), Group(name="old", size=2 * PEOPLE // 3))
    cohorts, made = scored(ALWAYS.model_copy(update={"group": groups}), SURE, old=steep)
    assert made.answers.groups == ("young", "old")
    old = made.answers.group == 1
    assert old.sum() == 2 * PEOPLE // 3
    level, x, slope = own_lines(made)
    for of in (old, ~old):
        assert agrees((slope - made.lines.gain)[of], 2.0)
        assert agrees((level - made.lines.bias - made.lines.gain * x)[of], 0.4)
    means = [made.lines.gain[of].mean() for of in (old, ~old)]
    assert means[0] / means[1] == pytest.approx(8 / 5, rel=0.02)
    assert cohorts.population.gain == pytest.approx(np.mean(means), rel=0.02)
    biases = [made.lines.bias[of].mean() for of in (old, ~old)]
    assert cohorts.population.bias == pytest.approx(np.mean(biases), rel=0.02)


def test_those_whom_the_rules_leave_out_have_no_line() -> None:
    late = PAPER.model_copy(update={"exclusions": Exclusions(max_reaction_s=1.0, min_trials=3)})
    every, some = (
        AnsweredCohorts(cohorts=PeopleCohorts(study=study, participants=9)).cohort("3")
        for study in (PAPER, late)
    )
    kept = [every.answers.ratings.subjects.index(who) for who in some.answers.ratings.subjects]
    assert 0 < len(kept) < 9
    np.testing.assert_array_equal(some.lines.gain, every.lines.gain[kept])
    np.testing.assert_array_equal(some.lines.bias, every.lines.bias[kept])


def test_without_known_friction_there_is_no_line_and_no_trial() -> None:
    surface = PAPER.surface.model_copy(update={"kind": "given", "length_m": 0.1})
    study = PAPER.model_copy(update={"surface": surface})
    people = replace(DEFAULT, effect={"voltage": 2.0})
    cohorts = PeopleCohorts(
        study=study,
        participants=4,
        population=people,
        rig=Calibration.of(GivenSurface(length_m=0.1)),
    )
    made = AnsweredCohorts(cohorts=cohorts).cohort("a")
    assert len(made.answers.ratings.rating) == 0
    assert np.isnan(made.lines.gain).all()
    assert np.isnan(made.lines.bias).all()
