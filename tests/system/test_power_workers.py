"""Power analyses on real workers, of joblib and of Dask, that are stopped or killed half-way."""

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

from analysis.power.engine import completed
from protocol.study_file.loading import template
from tests.analysis.power.simulated_job import job, joined, numbers_alone, numbers_by, wanted
from tests.runner.command_line import TOUCHBEAM

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
    done = {}
    for task, records in completed(job(), wanted(), 1, address):
        done[task] = records
        end(first)
    assert joined(done).tobytes() == alone.tobytes()


def document(folder: Path, *options: str) -> dict[str, object]:
    few = ("--participants", "3", "--studies", "5", "--null-studies", "150", "--seed", "2")
    command = (TOUCHBEAM, "power", str(folder), *few, *options, "--json")
    report = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    assert report.pop("elapsed_s") > 0
    return dict(report)


def test_here_and_on_a_cluster_the_document_is_the_same(cluster: Cluster, tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(template("paper"))
    here = document(tmp_path, "--workers", "1")
    there = document(tmp_path, "--scheduler", cluster[0])
    assert (here.pop("workers"), there.pop("workers")) == (1, 1)  # the first worker was killed
    assert json.dumps(here) == json.dumps(there)


def workers_of(parent: int) -> list[psutil.Process]:
    """The processes in which joblib computes for another one."""
    children = psutil.Process(parent).children()
    return [child for child in children if "LokyProcess" in " ".join(child.cmdline())]


def are_busy(workers: list[psutil.Process]) -> bool:
    # They have imported what they need, and compute.
    return len(workers) == 2 and all(worker.cpu_times().user > 3 for worker in workers)


MANY = ("--participants", "3", "--studies", "4", "--null-studies", "100000")


def test_ctrl_c_ends_all_workers_and_says_so_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(template("paper"))
    command = (TOUCHBEAM, "power", str(tmp_path), *MANY, "--workers", "2")
    with running(*command, folder=tmp_path) as process:
        wait_for(lambda: are_busy(workers_of(process.pid)), process)
        workers, stopped_s = workers_of(process.pid), time.monotonic()
        os.killpg(process.pid, signal.SIGINT)  # as a terminal sends it, to all of them
        assert process.wait(WITHIN_S) == 1
        psutil.wait_procs(workers, WITHIN_S)
        taken_s = time.monotonic() - stopped_s
        assert not [each for each in workers if each.is_running()], "a worker goes on"
    assert (tmp_path / "out.txt").read_text() == "touchbeam: stopped by SIGINT\n"
    assert taken_s < 20  # some tenths of a second on a computer that does nothing else


def test_a_killed_worker_is_said_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(template("paper"))
    command = (TOUCHBEAM, "power", str(tmp_path), *MANY, "--workers", "2")
    with running(*command, folder=tmp_path) as process:
        wait_for(lambda: are_busy(workers_of(process.pid)), process)
        workers_of(process.pid)[0].kill()
        assert process.wait(WITHIN_S) == 1
    assert (tmp_path / "out.txt").read_text() == (
        "touchbeam: a process that computed was killed, as happens where memory runs out\n"
    )


def test_a_lost_scheduler_is_said_in_one_line(cluster: Cluster, tmp_path: Path) -> None:
    address, (scheduler, _, second) = cluster
    (tmp_path / "study.toml").write_text(template("paper"))
    command = (TOUCHBEAM, "power", str(tmp_path), *MANY, "--scheduler", address)
    before_s = cpu_s(second.pid)
    with running(*command, folder=tmp_path) as process:
        wait_for(lambda: cpu_s(second.pid) > before_s + 3, process)
        end(scheduler)
        assert process.wait(WITHIN_S) == 1
    said = f"touchbeam: {address}: the scheduler ended or cannot be reached\n"
    assert (tmp_path / "out.txt").read_text() == said


def cpu_s(pid: int) -> float:
    """Processor time of a process and of its children."""
    process = psutil.Process(pid)
    return float(sum(each.cpu_times().user for each in (process, *process.children())))
