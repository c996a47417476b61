"""What the report costs as the cohort grows: time, memory, and how both follow its size."""

import os
import resource
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare, tell
from benchmarks.large_studies import large_study

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))
COHORTS = (125, 250, 500, 1000)


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _reported(folder: Path, *options: str) -> tuple[float, float]:
    """Report the study; return processor time and wall time, s."""
    used_s, began_s = _children_s(), perf_counter()
    environment = {"TOUCHBEAM_CACHE": "off", **os.environ, "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(
        [TOUCHBEAM, "report", str(folder), *options],
        check=True,
        capture_output=True,
        env=environment,
    )
    return _children_s() - used_s, perf_counter() - began_s


def test_1000_participants_of_40_trials_take_a_minute_and_2_gb_and_time_grows_linearly(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    folders = [large_study(tmp_path / str(count), count) for count in COHORTS]

    start_s, _ = _reported(large_study(tmp_path / "few", 2))

    def reported() -> list[tuple[float, float]]:
        return [_reported(folder) for folder in folders]

    took = benchmark.pedantic(reported, rounds=1)
    beyond_start = [max(used_s - start_s, 0.1) for used_s, _ in took]
    exponent = float(np.polyfit(np.log(COHORTS), np.log(beyond_start), 1)[0])
    most_gb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024**2
    tell(
        benchmark,
        f"reports on {', '.join(f'{count:,}' for count in COHORTS)} participants x 40 scores",
        processor_time=", ".join(f"{used_s:.0f}" for used_s, _ in took) + " s",
        memory=f"{most_gb:.2f} GB at most",
        it_grows_by_the_power=f"{exponent:.2f}",
    )
    assert took[-1][1] <= 60
    assert most_gb <= 2
    assert exponent <= 1.1


IMPORT = (
    "import numpy, pandas, jinja2, pydantic, typer, rich.console, sqlite3, scipy.stats, "
    "scipy.optimize, scipy.special, matplotlib.figure, matplotlib.font_manager, "
    "matplotlib.backends.backend_agg, matplotlib.backends.backend_svg"
)


@pytest.mark.parametrize(("again", "most"), [(False, 4.0), (True, 2.5)])
def test_a_report_of_five_people_costs_a_few_imports_of_all_it_needs(
    benchmark: BenchmarkFixture,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    again: bool,
    most: float,
) -> None:
    folder = large_study(tmp_path / "study", 5)
    imports: list[float] = []

    def reported() -> float:
        monkeypatch.setenv("TOUCHBEAM_CACHE", str(tmp_path / f"cache{len(imports)}"))
        before_s = _children_s()
        subprocess.run([sys.executable, "-c", IMPORT], check=True)
        imports.append(_children_s() - before_s)
        first_s, _ = _reported(folder)
        return _reported(folder, "--out", str(tmp_path / "elsewhere"))[0] if again else first_s

    reports = [reported(), reported(), benchmark.pedantic(reported, rounds=1)]
    work = f"report of five people{', again, into another folder' if again else ''}"
    ratio = compare(benchmark, work, "the import of all it needs", reports, imports)
    assert ratio <= most


def test_all_choices_of_analysis_cost_less_than_the_report(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    folder = large_study(tmp_path / "study", 20)
    plain_s, _ = _reported(folder)

    def explored() -> float:
        return _reported(folder, "--sections", "multiverse")[0]

    alone_s = benchmark.pedantic(explored, rounds=1)
    work = "all choices of analysis (20 participants), alone"
    compare(benchmark, work, "a report without them", [alone_s], [plain_s])
    assert alone_s <= plain_s
