from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest

from analysis.power.engine import completed
from analysis.power.job import Design, Job, tasks
from analysis.power.track_diagnosands import track_findings
from analysis.power.track_power import _of_three, by_chance, shares, track_rows, truths
from device.friction.changes import friction_difference
from device.friction.scenes import NOMINAL
from device.people.answering import TRACK_NUMBERS, Answering
from device.people.person import DEFAULT, People, Person
from protocol.registration.registration import threshold_of
from protocol.study.track import Find, Task
from protocol.study_file.loading import parsed_study, template
from tests.analysis.power.kept_in_memory import Memory

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
    rows = track_rows(study, population, NOMINAL, 8, [f"1/{number}" for number in range(30)])
    harder, easier = "of nine in ten", "smallest amplitude"
    asked = [
        threshold_of(harder, easier),
        threshold_of(easier, harder),
        f"Weber fraction of {easier} below 0.5",
        f"Weber fraction of {easier} below 0.01",
    ]
    told = track_findings(study, 8, rows, asked)
    (differ,) = told.differences
    assert (differ.above, differ.below) == ("of nine in ten", "smallest amplitude")
    assert differ.ratio_db > 3
    assert differ.power.value > 0.8
    first = told.tracks[0]
    assert first.trials.value == study.track[0].trials
    assert first.rmse_db.value < 3
    assert first.coverage.value > 0.85
    assert told.record()["tracks"][0]["rmse_db_mc_error"] > 0
    powers = [each.power.value for each in told.registered]
    assert powers == [differ.power.value, 0.0, differ.power.value, 0.0]
    limit = first.weber_limit
    for least, most, some in ((0.8, 1.0, limit + 1e-6), (0.0, 0.8, limit - 1e-6)):
        below = f"Weber fraction of {easier} below {some:.6f}"
        (own,) = track_findings(study, 8, rows, [below]).registered
        assert least <= own.power.value <= most


def test_workers_and_longer_runs_give_the_same_studies() -> None:
    job = Job(study=TEXT, version=version("touchbeam"), seed=2)
    few, many = (tasks(Design(participants=2, repeats=1), "tracks", it) for it in (101, 103))
    one, two = (dict(completed(job, few, Memory(), workers)) for workers in (1, 2))
    assert [two[task].tobytes() for task in few] == [one[task].tobytes() for task in few]
    longer = dict(completed(job, many[1:], Memory(), 1))[many[1]]
    assert longer[:1] == pytest.approx(one[few[1]], nan_ok=True)
    assert len(np.unique(longer[:, 1])) == len(longer)  # and no study comes twice


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
