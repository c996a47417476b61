"""The engine: the same numbers by any number of workers, and from where it was stopped."""

import socket
import threading
from contextlib import suppress

import numpy as np
import pytest

from analysis.power.engine import completed, connected, kept
from analysis.power.job import Job, Task, numbers
from protocol.errors import BadInput, WorkFailed
from tests.analysis.power.kept_in_memory import (
    DESIGN,
    Memory,
    job,
    numbers_alone,
    numbers_by,
    wanted,
)


def test_one_two_and_four_workers_give_the_same_bits() -> None:
    alone = numbers_alone()
    assert alone.tobytes() == numbers_by(2).tobytes()
    assert alone.tobytes() == numbers_by(4).tobytes()


def test_a_run_that_stops_goes_on_from_there() -> None:
    memory, whole = Memory(), numbers_alone()
    stopped = completed(job(), wanted(), memory, 1)
    next(stopped)
    stopped.close()
    assert len(memory.kept) == 1
    kept = dict(memory.kept)
    assert numbers_by(1, kept=memory).tobytes() == whole.tobytes()
    assert {name: memory.kept[name] for name in kept} == kept


@pytest.mark.parametrize("content", [b"", b"no numbers", b"\x93NUMPY\x01\x00"])
def test_a_chunk_that_cannot_be_read_is_computed_again(content: bytes) -> None:
    (task,) = wanted(fitted=0)
    memory = Memory({task.name: content})
    ((_, found),) = completed(job(), [task], memory, 1)
    assert found.tobytes() == numbers(job(), task).tobytes()
    assert memory.kept[task.name] != content


@pytest.mark.parametrize("place", [0, 40, 60, -2])
def test_a_chunk_with_one_damaged_byte_is_computed_again(place: int) -> None:
    (task,) = wanted(fitted=0)
    memory = Memory()
    list(completed(job(), [task], memory, 1))
    whole = memory.kept[task.name]
    damaged = bytearray(whole)
    damaged[place] ^= 1
    memory.kept[task.name] = bytes(damaged)
    ((_, found),) = completed(job(), [task], memory, 1)
    assert found.tobytes() == numbers(job(), task).tobytes()
    assert memory.kept[task.name] == whole


def test_a_chunk_of_another_task_or_job_is_computed_again() -> None:
    one, other = (Task(DESIGN, kind, 0, 20) for kind in ("tested", "null"))
    memory, elsewhere = Memory(), Memory()
    list(completed(job(), [one, other], memory, 1))
    list(completed(job(2), [one], elsewhere, 1))
    whole = memory.kept[one.name]
    for wrong in (memory.kept[other.name], elsewhere.kept[one.name]):
        memory.kept[one.name] = wrong
        ((_, found),) = completed(job(), [one], memory, 1)
        assert found.tobytes() == numbers(job(), one).tobytes()
        assert memory.kept[one.name] == whole


def test_a_chunk_sealed_by_somebody_else_is_computed_again() -> None:
    (task,) = wanted(fitted=0)
    theirs = Memory(key=b"theirs")
    list(completed(job(), [task], theirs, 1))
    assert kept(job(), task, Memory(theirs.kept)) is None
    assert kept(job(), task, theirs) is not None


def test_a_longer_run_has_the_studies_of_a_shorter_one() -> None:
    (short, *_), (long, *_) = wanted(fitted=2), wanted(fitted=4)
    np.testing.assert_array_equal(numbers(job(), short), numbers(job(), long)[:2])


def test_another_seed_gives_other_studies() -> None:
    task = wanted()[-1]
    assert (numbers(job(1), task) != numbers(job(2), task)).any()
    assert job(1).digest != job(2).digest


def test_a_worker_of_another_version_is_refused() -> None:
    other = Job(study=job().study, version="0.0.1", seed=1)
    with pytest.raises(WorkFailed, match=r"0\.0\.1 asks"):
        numbers(other, wanted()[0])


def test_an_address_that_is_none_is_refused() -> None:
    with (
        pytest.raises(BadInput, match="must be an address such as tcp://HOST:8786, got 'nowhere'"),
        connected("nowhere"),
    ):
        pass


@pytest.mark.parametrize("greeting", [b"", b"SSH-2.0-OpenSSH_9\r\n" + bytes(4000)])
def test_what_is_no_scheduler_is_told_by_how_it_answers(
    greeting: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("analysis.power.engine._ANSWER_WITHIN_S", 0.5)
    peers = []

    def serve(server: socket.socket) -> None:
        with suppress(OSError):  # the server is closed
            while True:
                peers.append(server.accept()[0])
                peers[-1].sendall(greeting)

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=serve, args=(server,), daemon=True).start()
        with (
            pytest.raises(WorkFailed, match="no Dask scheduler answers there"),
            connected(f"tcp://127.0.0.1:{server.getsockname()[1]}"),
        ):
            pass
    assert peers, "nobody asked"
