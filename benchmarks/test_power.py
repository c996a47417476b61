"""What a power analysis costs on two cores, and what the second core is worth.

The ratio needs a quiet machine with two cores; it is taken in one run.
"""

from importlib.metadata import version
from time import perf_counter, process_time

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from analysis.power.engine import completed
from analysis.power.job import Design, Job, Kind, Task, tasks
from analysis.power.track_power import track_rows
from benchmarks.compared import compare, tell
from device.friction.scenes import NOMINAL
from device.people.person import DEFAULT
from protocol.study_file.loading import parsed_study, template
from tests.analysis.power.kept_in_memory import Memory

PAPERS = Design(participants=9, repeats=1)
LARGE = Design(participants=20, repeats=4)
"""Twenty people with twenty trials each."""


def seconds(wanted: list[Task], workers: int) -> float:
    job = Job(study=template("paper"), version=version("touchbeam"), seed=1)
    start = perf_counter()
    assert len(list(completed(job, wanted, Memory(), workers))) == len(wanted)
    return perf_counter() - start


@pytest.mark.parametrize(
    ("design", "kind", "studies", "most_s"),
    [(PAPERS, "tested", 20_000, 60), (LARGE, "fitted", 1_000, 300)],
)
def test_studies_on_two_cores(
    benchmark: BenchmarkFixture, design: Design, kind: Kind, studies: int, most_s: float
) -> None:
    wanted = tasks(design, kind, studies)
    taken = benchmark.pedantic(seconds, args=(wanted, 2), rounds=1)
    people, trials = design.participants, 5 * design.repeats
    rate = f"{studies / taken:,.3g} studies per second"
    tell(benchmark, f"{studies:,} studies of {people} x {trials} scores, {kind}", two_workers=rate)
    assert taken <= most_s


def test_two_workers_are_worth_1_8(benchmark: BenchmarkFixture) -> None:
    wanted = tasks(LARGE, "fitted", 64)
    seconds(wanted[:4], 2)  # the workers are started, and stay
    one = seconds(wanted, 1)
    two = benchmark.pedantic(seconds, args=(wanted, 2), rounds=1)
    compare(benchmark, "fit 64 studies of 20 x 20 scores, two workers", "one worker", [two], [one])
    assert one / two >= 1.8


def test_thresholds_of_1_000_studies(benchmark: BenchmarkFixture) -> None:
    text = template("threshold").replace("trials = 40", "trials = 60", 1)
    study = parsed_study(text.replace("stop = { reversals = 12 }", ""))

    def found() -> float:
        start = process_time()
        track_rows(study, DEFAULT, NOMINAL, 12, [f"1/{number}" for number in range(1_000)])
        return process_time() - start

    taken = benchmark.pedantic(found, rounds=1)
    tell(
        benchmark,
        "thresholds of 1,000 studies of 12 people, 2 tracks of 60 trials each",
        processor_time=f"{taken:.0f} s",
    )
