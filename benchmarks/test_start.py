"""How fast short commands answer, against importing the library that they are made with."""

import subprocess
import sys
from pathlib import Path
from time import perf_counter

from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))
HELP = [TOUCHBEAM, "--help"]
TYPER = [sys.executable, "-c", "import typer"]
ROUNDS = 15


def _seconds(command: list[str]) -> float:
    start = perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return perf_counter() - start


def test_help_takes_at_most_1_3_imports_of_typer(benchmark: BenchmarkFixture) -> None:
    pairs = [(_seconds(HELP), _seconds(TYPER)) for _ in range(ROUNDS)]
    ratio = compare(benchmark, "touchbeam --help", "import typer", *zip(*pairs, strict=True))
    benchmark.pedantic(_seconds, args=(HELP,), rounds=3)
    assert ratio <= 1.3


def test_check_of_the_template_takes_at_most_5_imports_of_typer(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    # Typer, pydantic and numpy, which it cannot do without, take 3 of them.
    subprocess.run([TOUCHBEAM, "new", str(tmp_path / "study")], check=True, capture_output=True)
    command = [TOUCHBEAM, "check", str(tmp_path / "study")]
    pairs = [(_seconds(command), _seconds(TYPER)) for _ in range(ROUNDS)]
    ratio = compare(benchmark, "touchbeam check", "import typer", *zip(*pairs, strict=True))
    benchmark.pedantic(_seconds, args=(command,), rounds=3)
    assert ratio <= 5
