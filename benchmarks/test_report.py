"""What the report costs as the cohort grows: time, memory, and how both follow its size."""

import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare, tell
from benchmarks.large_studies import large_study

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))
COHORTS = (125, 250, 500, 1000)


class _Took(NamedTuple):
    used_s: float
    wall_s: float
    most_gb: float


def _ran(*command: str) -> _Took:
    """Run a command; return processor time, wall time and the largest of its processes."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    began_s = perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment)
    # Of this process alone: what the system tells of all that were waited for is the most so far.
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    wall_s = perf_counter() - began_s
    return _Took(used.ru_utime + used.ru_stime, wall_s, used.ru_maxrss / 1024**2)


def _reported(folder: Path, *options: str) -> _Took:
    return _ran(TOUCHBEAM, "report", str(folder), *options)


def test_1000_participants_of_40_trials_take_a_minute_and_little_memory_and_time_grows_linearly(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    folders = [large_study(tmp_path / str(count), count) for count in COHORTS]

    start_s = _reported(large_study(tmp_path / "few", 2)).used_s

    def reported() -> list[_Took]:
        return [_reported(folder) for folder in folders]

    took = benchmark.pedantic(reported, rounds=1)
    beyond_start = [max(each.used_s - start_s, 0.1) for each in took]
    exponent = float(np.polyfit(np.log(COHORTS), np.log(beyond_start), 1)[0])
    most_gb = max(each.most_gb for each in took)
    tell(
        benchmark,
        f"reports on {', '.join(f'{count:,}' for count in COHORTS)} participants x 40 scores",
        processor_time=", ".join(f"{each.used_s:.0f}" for each in took) + " s",
        memory=f"{most_gb:.2f} GB at most",
        it_grows_by_the_power=f"{exponent:.2f}",
    )
    assert took[-1].wall_s <= 60
    assert most_gb <= 0.6
    assert exponent <= 1.1


IMPORT = (
    "import numpy, pandas, jinja2, pydantic, typer, rich.console, sqlite3, scipy.stats, "
    "scipy.optimize, scipy.special, matplotlib.figure, matplotlib.font_manager, "
    "matplotlib.backends.backend_agg, matplotlib.backends.backend_svg"
)


def test_a_report_of_five_people_costs_at_most_4_imports_of_all_it_needs(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    folder = large_study(tmp_path / "study", 5)
    imports: list[float] = []

    def reported() -> float:
        imports.append(_ran(sys.executable, "-c", IMPORT).used_s)
        return _reported(folder).used_s

    reports = [reported(), reported(), benchmark.pedantic(reported, rounds=1)]
    work = "report of five people"
    ratio = compare(benchmark, work, "the import of all it needs", reports, imports)
    assert ratio <= 4.0
