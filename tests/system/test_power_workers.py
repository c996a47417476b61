"""Power analyses on real workers, of joblib and of Dask, that are killed half-way."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import psutil
import pytest

from analysis.power import power_report
from analysis.power.engine import completed
from protocol.study_file.loading import template
from tests.analysis.power.kept_in_memory import Memory, job, numbers_alone, numbers_by, wanted
from tests.runner.command_line import TOUCHBEAM, typed

DASK = str(Path(sys.executable).with_name("dask"))
WITHIN_S = 120


def wait_for(there: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + WITHIN_S
    while not there():
        assert process.poll() is None, "it ended before"
        assert time.monotonic() < until, "it takes too long"
        time.sleep(0.02)


@contextmanager
def running(*command: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A program with its children, all of which are ended afterwards."""
    with (folder / "out.txt").open("ab") as out:
        process = subprocess.Popen(
            command, cwd=folder, stdout=out, stderr=out, start_new_session=True
        )
    try:
        yield process
    finally:
        end(process)


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a program with its children, which are in its session."""
    if process.returncode is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


Cluster = tuple[str, list[subprocess.Popen[bytes]]]


@contextmanager
def cluster_in(folder: Path, size: int = 2) -> Iterator[Cluster]:
    """A scheduler's address, and the scheduler and its workers, on this machine alone."""
    file, here = folder / "scheduler.json", ("--host", "127.0.0.1", "--no-dashboard")
    with ExitStack() as stack:
        started = running(
            *(DASK, "scheduler", *here, "--port", "0", "--scheduler-file", str(file)),
            folder=folder,
        )
        scheduler = stack.enter_context(started)
        wait_for(file.exists, scheduler)
        address = json.loads(file.read_text())["address"]
        workers = [
            stack.enter_context(
                running(*(DASK, "worker", address, *here, "--nthreads", "1"), folder=folder)
            )
            for _ in range(size)
        ]
        yield address, [scheduler, *workers]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """One for the test that ends a worker and, with the other worker, that which ends the rest."""
    with cluster_in(tmp_path_factory.mktemp("cluster")) as started:
        yield started


def test_a_cluster_gives_the_same_bits_though_a_worker_is_killed(
    cluster: Cluster,
) -> None:
    address, (_, first, _) = cluster
    alone = numbers_alone()
    assert numbers_by(1, address).tobytes() == alone.tobytes()
    memory, found = Memory(), {}
    for task, numbers in completed(job(), wanted(), memory, 1, address):
        found[task] = numbers
        end(first)
    assert b"".join(found[task].tobytes() for task in wanted()) == alone.tobytes()
    assert memory.kept.keys() == {task.name for task in wanted()}


def worker_of(parent: int) -> int:
    """A process in which joblib computes for another one, 0 if there is none."""
    for process in psutil.Process(parent).children():
        if "LokyProcess" in " ".join(process.cmdline()):
            return int(process.pid)
    return 0


def ended_by(kill: Callable[[subprocess.Popen[bytes]], object], folder: Path, *options: str) -> str:
    """Start a power analysis, do what ends it once something is kept; return what it says."""
    folder.mkdir()
    (folder / "study.toml").write_text(template("paper"))
    many = ("--participants", "3", "--studies", "4", "--null-studies", "100000")
    with running(TOUCHBEAM, "power", str(folder), *many, *options, folder=folder) as process:
        wait_for(lambda: any((folder / "power").rglob("*.npy")), process)
        kill(process)
        assert process.wait(WITHIN_S) == 1
    assert any((folder / "power").rglob("*.npy"))
    return (folder / "out.txt").read_text()


GOES_ON = "; what is done is kept; the same command goes on from there\n"


def test_a_killed_worker_is_said_in_one_line(tmp_path: Path) -> None:
    said = ended_by(
        lambda process: os.kill(worker_of(process.pid), signal.SIGKILL),
        tmp_path / "study",
        *("--workers", "2"),
    )
    assert said == (
        "touchbeam: a process that computed was killed, as happens where memory runs out" + GOES_ON
    )


def test_a_lost_scheduler_is_said_in_one_line(cluster: Cluster, tmp_path: Path) -> None:
    address, (scheduler, *_) = cluster
    said = ended_by(lambda _: end(scheduler), tmp_path / "study", "--scheduler", address)
    assert said == f"touchbeam: {address}: the scheduler ended or cannot be reached" + GOES_ON


DESIGN = ("--participants", "4", "--studies", "5", "--null-studies", "600", "--seed", "2")
"""Three tasks of studies that are not fitted: one of them ends while the others go on."""


def test_a_killed_run_goes_on_and_ends_with_the_same_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    for folder in (killed, whole):
        folder.mkdir()
        (folder / "study.toml").write_text(template("paper"))
    chunks = killed / "power" / "chunks"
    asked = (*DESIGN, "--tests-only")
    begun = (TOUCHBEAM, "power", str(killed), *asked, "--workers", "2")
    with running(*begun, folder=tmp_path) as process:
        wait_for(lambda: len(list(chunks.rglob("*.npy"))) >= 1, process)
    assert not (killed / "power" / "power.json").exists(), "it was killed too late"
    kept = {path: path.stat().st_mtime_ns for path in chunks.rglob("*.npy")}
    monkeypatch.setattr(power_report, "figures", lambda _: {})
    for folder, workers in ((killed, "2"), (whole, "1")):
        assert typed("power", folder, *asked, "--workers", workers) == 0
    assert {path: path.stat().st_mtime_ns for path in kept} == kept, "it went on from there"
    numbers = [(folder / "power" / "power.json").read_bytes() for folder in (killed, whole)]
    assert numbers[0] == numbers[1]
    assert not list(killed.rglob(".touchbeam-*"))
