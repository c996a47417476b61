"""What a power analysis costs on two cores, and what the second core is worth.

The ratio needs a quiet machine with two cores; it is taken in one run.
"""

from importlib.metadata import version
from time import perf_counter, process_time

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from analysis.power.designs import Design
from analysis.power.engine import completed
from analysis.power.job import Job, tasks
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.study_records import asked_by
from analysis.power.track_records import track_records
from benchmarks.compared import compare, tell
from protocol.study_file.loading import parsed_study, template

PAPERS = Design(participants=9, repeats=1)
LARGE = Design(participants=20, repeats=4)
"""Twenty people with twenty trials each."""


def seconds(design: Design, studies: int, workers: int, *, models: bool) -> float:
    job = Job(study=template("paper"), version=version("touchbeam"), seed=1, models=models)
    wanted = tasks(job, design, studies, 0)
    start = perf_counter()
    assert len(list(completed(job, wanted, workers))) == len(wanted)
    return perf_counter() - start


@pytest.mark.parametrize(
    ("design", "models", "studies", "most_s"),
    [(PAPERS, False, 20_000, 60), (PAPERS, True, 200, 120), (LARGE, True, 200, 120)],
)
def test_studies_on_two_cores(
    benchmark: BenchmarkFixture, design: Design, models: bool, studies: int, most_s: float
) -> None:
    taken = benchmark.pedantic(
        seconds, args=(design, studies, 2), kwargs={"models": models}, rounds=1
    )
    people, trials = design.participants, 5 * design.repeats
    rate = f"{studies / taken:,.3g} studies per second"
    kind = "fitted" if models else "tested"
    tell(benchmark, f"{studies:,} studies of {people} x {trials} scores, {kind}", two_workers=rate)
    assert taken <= most_s


def test_two_workers_are_worth_1_8(benchmark: BenchmarkFixture) -> None:
    seconds(LARGE, 16, 2, models=True)  # the workers are started, and stay
    one = seconds(LARGE, 64, 1, models=True)
    two = benchmark.pedantic(seconds, args=(LARGE, 64, 2), kwargs={"models": True}, rounds=1)
    compare(benchmark, "fit 64 studies of 20 x 20 scores, two workers", "one worker", [two], [one])
    assert one / two >= 1.8


def test_thresholds_of_1_000_studies(benchmark: BenchmarkFixture) -> None:
    text = template("threshold").replace("trials = 40", "trials = 60", 1)
    study = parsed_study(text.replace("stop = { reversals = 12 }", ""))
    asked, cohorts = asked_by(study), PeopleCohorts(study=study, participants=12)

    def simulated() -> float:
        start = process_time()
        for first in range(0, 1_000, 100):
            keys = [f"1/{number}" for number in range(first, first + 100)]
            track_records(asked, cohorts, keys, first)
        return process_time() - start

    taken = benchmark.pedantic(simulated, rounds=1)
    tell(
        benchmark,
        "thresholds of 1,000 studies of 12 people, 2 tracks of 60 trials each",
        processor_time=f"{taken:.0f} s",
    )
