"""What the demo costs: time, and the memory of all its processes together."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import tell

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))


def _family_bytes(process: int) -> int:
    """Resident memory of a process and its children, from the process table."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    own = Path(f"/proc/{process}/statm").read_text().split()[1]
    return int(own) * 4096 + sum(_family_bytes(int(child)) for child in children)


def _demo(folder: Path) -> float:
    """Run the demo and return the most memory it ever took, in MB."""
    process = subprocess.Popen([TOUCHBEAM, "demo", "--out", str(folder)], stdout=subprocess.DEVNULL)
    most = 0
    while process.poll() is None:
        try:
            most = max(most, _family_bytes(process.pid))
        except (OSError, IndexError):
            continue  # a process ended between two looks
        time.sleep(0.02)
    assert process.returncode == 0
    return most / 1e6


def test_the_demo_takes_a_minute_and_400_mb_at_most(benchmark: BenchmarkFixture) -> None:
    with tempfile.TemporaryDirectory() as place:
        most_mb = benchmark.pedantic(_demo, args=(Path(place, "demo"),), rounds=1)
    tell(benchmark, "the demo: 9 participants and their report", memory=f"{most_mb:.0f} MB")
    assert benchmark.stats.stats.max <= 60
    assert most_mb <= 400
