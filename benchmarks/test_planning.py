"""How fast plans are drawn and checked, against work of the same kind that others do."""

import subprocess
import sys
from pathlib import Path
from time import perf_counter

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare, tell
from protocol.plan.plan import plan
from protocol.proof.trial_checks import cohort_problems
from protocol.study_file.loading import parsed_study, template

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))


@pytest.mark.parametrize("name", ["paper", "extended"])
def test_a_thousand_participants_are_planned(benchmark: BenchmarkFixture, name: str) -> None:
    """At most as long as reading the study file a thousand times."""
    text = template(name)
    study = parsed_study(text)
    start = perf_counter()
    for _ in range(100):
        parsed_study(text)
    reading_s = 10 * (perf_counter() - start)
    plans = benchmark.pedantic(lambda: [plan(study, slot) for slot in range(1_000)], rounds=5)
    work = f"plan 1,000 participants of the study {name}"
    took_s = benchmark.stats["min"]
    compare(
        benchmark, work, "read the study file as often", [took_s], [reading_s], "proved balanced"
    )
    assert cohort_problems(study, plans[:40]) == []
    assert benchmark.stats["min"] < reading_s


def test_check(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """Reported, not judged: most of it is importing pydantic and numpy."""
    study = tmp_path / "study"
    subprocess.run([TOUCHBEAM, "new", str(study)], check=True, capture_output=True)
    command = [TOUCHBEAM, "check", str(study)]
    tell(benchmark, "touchbeam check, a process of its own")
    benchmark.pedantic(lambda: subprocess.run(command, check=True, capture_output=True), rounds=10)
