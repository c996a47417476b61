from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest

from analysis.power.designs import Design
from analysis.power.engine import completed
from analysis.power.job import Job, tasks
from analysis.power.null_cohorts import KINDS
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.power_report import answer
from analysis.power.power_summary import summary
from analysis.power.study_records import Records, asked_by
from analysis.power.track_records import _of_three, by_chance, shares, track_records, truths
from analysis.simulation import names_of
from device.friction.calibration import NOMINAL
from device.friction.changes import friction_difference
from device.people.answering import TRACK_NUMBERS, Answering
from device.people.person import DEFAULT, LogNormal, People, Person, people_of, person_name
from protocol.study.track import Find, Task
from protocol.study_file.loading import parsed_study, template

TEXT = template("threshold")
DRAWS = 40_000


def test_three_touches_that_are_alike_are_named_by_chance() -> None:
    for odd in (True, False):
        by_chance, surely = _of_three(np.array([[0.0], [11.0]]), odd=odd)[:, 0]
        assert by_chance == pytest.approx(1 / 3, abs=1e-3)
        assert surely == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("task", "find"),
    [
        ("two intervals", "smoother"),
        ("three intervals", "different"),
        ("three intervals", "smoother"),
        ("yes or no", "smoother"),
        ("yes or no", "different"),
        ("yes or no", "rougher"),
    ],
)
def test_shares_are_those_of_the_people_who_rehearse(task: Task, find: Find) -> None:
    study = parsed_study(TEXT)
    track = study.track[0].model_copy(update={"task": task, "find": find})
    person = Person(felt_noise=0.05, criterion=0.04, criterion_less=0.06, skin=1.2)
    level = 24
    standard = track.standard
    assert standard is not None
    smoother = friction_difference(study, standard, track.at(level), NOMINAL)
    felt = np.zeros((DRAWS, track.intervals))
    felt[:, -1] = -1.2 * smoother  # the comparison is the last touch
    people = People.of([person] * DRAWS)
    u = np.random.default_rng(7).random((DRAWS, TRACK_NUMBERS))
    named, _ = Answering(people).track(felt, find, u)
    right = named == (1 if track.intervals == 1 else track.intervals - 1)
    wanted = shares(study, track, People.of([person]), NOMINAL)[level, 0]
    assert right.mean() == pytest.approx(wanted, abs=4 * np.sqrt(0.25 / DRAWS))
    assert 0.01 < wanted < 0.99


def test_a_threshold_is_where_the_curve_has_its_share_or_beyond_the_levels() -> None:
    study = parsed_study(TEXT)
    track = study.track[0]
    people = People.of([Person(felt_noise=0.05), Person(felt_noise=5.0)])
    right = shares(study, track, people, NOMINAL)
    found, beyond = truths(track, right, by_chance(track, people))
    at = np.interp(np.log(found), np.log(track.distances), right[:, 0])
    assert at == pytest.approx(track.share, abs=2e-3)
    assert np.isnan(beyond)


def test_a_track_of_sensitive_people_lies_below_one_of_a_harder_rule() -> None:
    text = TEXT.replace('name = "by a staircase"', 'name = "of nine in ten"')
    text = text.replace("stop = { reversals = 12 }", "threshold_at = 0.91")
    study = parsed_study(text)
    population = replace(DEFAULT, typical=Person(felt_noise=0.05), varied={})
    cohorts = PeopleCohorts(study=study, participants=14, population=population)
    asked = asked_by(study)
    records = track_records(asked, cohorts, [f"1/{number}" for number in range(30)], first=0)
    assert asked.tests == ["thresholds: smallest amplitude - of nine in ten"]
    design = Design(participants=14, repeats=1)
    nulls = {kind.name: Records.of(asked, []) for kind in KINDS}
    report = summary(design, asked, Records.of(asked, records), nulls)
    (differ,) = report.tests
    assert differ.power.value > 0.8
    false = (*differ.false.values(), *report.any_false_claim.values())
    assert np.isnan([measured.value for measured in (differ.supported, report.told, *false)]).all()
    first, second = report.estimates
    assert first.name == "threshold of smallest amplitude, dB"
    assert first.rmse.value < 4
    assert first.rmse.error > 0
    assert first.coverage.value > 0.85
    assert 3 < first.width.value < 32
    assert first.estimable.value == second.estimable.value == 1
    begin = "14 participants x 1 repeat: threshold of smallest amplitude to within ±"
    assert answer([report]).startswith(begin)


def test_errors_are_those_of_the_estimates_and_nobody_beyond_the_levels_counts() -> None:
    study = parsed_study(TEXT)
    track = study.track[0]
    noise = LogNormal(median=0.1, log_sd=1.5)
    population = replace(DEFAULT, typical=Person(), varied={"felt_noise": noise})
    cohorts = PeopleCohorts(study=study, participants=40, population=population)
    ((_, estimates, _),) = track_records(asked_by(study), cohorts, ["1"], first=0)
    names = [person_name("1", who) for who in names_of(40)]
    people = people_of(population, names)
    truth = truths(track, shares(study, track, people, NOMINAL), by_chance(track, people))
    within = int(np.isfinite(truth).sum())
    number, error, squared, covered, width = estimates["threshold of smallest amplitude, dB"]
    assert 0 < number == within < 40
    assert squared >= error**2 / within
    assert 0.8 * within < covered <= within
    assert width > np.sqrt(squared / within)


def test_workers_and_longer_runs_give_the_same_studies() -> None:
    job = Job(study=TEXT, version=version("touchbeam"), seed=2, models=False)
    few, many = (tasks(job, Design(participants=2, repeats=1), it, 0) for it in (101, 103))
    one, two = (dict(completed(job, few, workers)) for workers in (1, 2))
    for task in few:
        assert [part.tobytes() for part in two[task]] == [part.tobytes() for part in one[task]]
    longer = dict(completed(job, many[1:], 1))[many[1]].estimates
    assert longer[:1] == pytest.approx(one[few[1]].estimates)
    assert len(np.unique(longer[:, 0, 1])) == len(longer)  # and no study comes twice


def test_orders_of_constant_stimuli_do_not_depend_on_the_task() -> None:
    text = TEXT[: TEXT.index("[[track]]")] + VOLTAGES
    cohorts = PeopleCohorts(study=parsed_study(text), participants=6)
    keys = [f"1/{number}" for number in range(4)]
    asked = asked_by(cohorts.study)
    whole = track_records(asked, cohorts, keys, first=0)
    last = track_records(asked, cohorts, keys[2:], first=2)
    elsewhere = track_records(asked, cohorts, keys[2:], first=0)
    (name,) = asked.estimates
    for study, same, other in zip(whole[2:], last, elsewhere, strict=True):
        assert study.estimates[name] == pytest.approx(same.estimates[name])
        assert other.estimates[name] != pytest.approx(same.estimates[name])


def test_places_differ_as_their_frictions_do() -> None:
    text = TEXT[: TEXT.index("[[track]]")] + PLACES
    study = parsed_study(text)
    track = study.track[0]
    right = shares(study, track, People.of([Person(felt_noise=0.05)]), NOMINAL)[:, 0]
    standard = track.standard
    assert standard is not None
    both = [
        friction_difference(study, a, b, NOMINAL)
        for a, b in ((standard, track.at(2)), (track.at(2), standard))
    ]
    assert both[0] == pytest.approx(-both[1])
    assert abs(both[0]) > 0.01
    assert np.ptp(right) > 0.05


PLACES = """
[[track]]
name = "place"
task = "two intervals"
method = "constant"
axis = "place"
levels = { from = 0.02, to = 0.04, count = 5, spaced = "equal steps" }
standard = { place = "smooth", voltage_v = 100, place_m = 0.0414 }
comparison = { place = "smooth", voltage_v = 100 }
trials = 10
"""

VOLTAGES = """
[[track]]
name = "voltage"
task = "two intervals"
method = "constant"
axis = "voltage"
levels = { from = 4, to = 160, count = 9, spaced = "equal ratios" }
standard = { place = "smooth", voltage_v = 0 }
comparison = { place = "smooth" }
trials = 36
"""
