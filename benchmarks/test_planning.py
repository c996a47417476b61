"""How fast plans are drawn and checked, against work of the same kind that others do."""

import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from protocol.plan.plan import plan
from protocol.proof.cohort import cohort_problems
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
    benchmark.extra_info["ratio to reading"] = round(benchmark.stats["min"] / reading_s, 2)
    assert cohort_problems(study, plans[:40]) == []
    assert benchmark.stats["min"] < reading_s


def test_check_against_help(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """At most three times as long, both from compiled modules as after `make` set them up."""
    study = tmp_path / "study"
    subprocess.run([TOUCHBEAM, "new", str(study)], check=True, capture_output=True)
    commands = [TOUCHBEAM, "check", str(study)], [TOUCHBEAM, "--help"]
    pairs = [[_seconds(command) for command in commands] for _ in range(20)]
    ratio = median(ours for ours, _ in pairs) / median(peer for _, peer in pairs)
    benchmark.extra_info["ratio to help"] = round(ratio, 2)
    benchmark.pedantic(_seconds, args=(commands[0],), rounds=3)
    assert ratio < 3


def _seconds(command: list[str]) -> float:
    start = perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return perf_counter() - start
