"""The engine: the same numbers by any number of workers."""

import socket
import threading
from contextlib import ExitStack, suppress

import numpy as np
import pytest

from analysis.power.designs import Design
from analysis.power.engine import connected
from analysis.power.job import Job, asked, records, tasks
from device.friction.calibration import Calibration
from device.friction.surfaces import GivenSurface
from protocol.errors import BadInput, WorkFailed
from protocol.registration.registration import GAINS
from protocol.study_file.loading import template, with_digests
from tests.analysis.power.simulated_job import job, numbers_alone, numbers_by, wanted


def test_one_two_and_four_workers_give_the_same_bits() -> None:
    alone = numbers_alone()
    assert alone.tobytes() == numbers_by(2).tobytes()
    assert alone.tobytes() == numbers_by(4).tobytes()


def test_a_longer_run_has_the_studies_of_a_shorter_one() -> None:
    (short, *_), (long, *_) = wanted(studies=2), wanted(studies=4)
    for few, many in zip(records(job(), short), records(job(), long), strict=True):
        np.testing.assert_array_equal(few, many[:2])


def test_studies_without_models_are_those_with_models() -> None:
    task, fitted = wanted(studies=2)[0], records(job(), wanted(studies=2)[0])
    tested = records(job(models=False), task)
    names = asked(job()).tests
    assert [name for name in names if name not in asked(job(models=False)).tests] == [GAINS]
    without_gains = np.delete(fitted.p, names.index(GAINS), axis=1)
    np.testing.assert_array_equal(tested.p, without_gains)
    assert tested.estimates.shape[1] == 0
    assert fitted.estimates.shape[1] == 2
    assert np.isnan(tested.told).all()
    assert set(fitted.told.tolist()) <= {0.0, 1.0}


@pytest.mark.parametrize(
    ("people", "alike"),
    [
        ("", True),
        ("[population]\ngain = { mean = 4.0, sd = 1.0 }\n", True),
        ("[group.older.population]\ngain = { mean = 2.0, sd = 1.0 }\n", False),
    ],
)
def test_groups_are_alike_unless_one_has_people_of_its_own(people: str, alike: bool) -> None:
    text = with_digests(template("plate"), "pictures", {"plate.png": "0" * 64})
    rig = Calibration.of(GivenSurface(length_m=0.1))
    plate = Job(study=text, version="", seed=1, models=False, rig=rig, people=people)
    assert asked(plate).alike == alike
    assert not asked(job()).alike, "without groups"


def test_no_task_has_more_people_than_memory_is_for() -> None:
    crowd = Design(participants=1000, repeats=1)
    sizes = [task.count for task in tasks(job(models=False), crowd, 5, 3)]
    assert sizes == [2, 2, 1, *[2, 1] * 3]
    assert [task.first for task in tasks(job(), crowd, 5, 0)] == [0, 4]


def test_another_seed_gives_other_studies() -> None:
    task = wanted()[-1]
    assert (records(job(1), task).p != records(job(2), task).p).any()


def test_a_worker_of_another_version_is_refused() -> None:
    other = Job(study=job().study, version="0.0.1", seed=1)
    with pytest.raises(WorkFailed, match=r"0\.0\.1 asks"):
        records(other, wanted()[0])


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

    def serve() -> None:
        with suppress(OSError):  # the server is shut down
            while True:
                peers.append(opened.enter_context(server.accept()[0]))
                peers[-1].sendall(greeting)

    with ExitStack() as opened:
        server = opened.enter_context(socket.create_server(("127.0.0.1", 0)))
        serving = threading.Thread(target=serve)
        serving.start()
        opened.callback(serving.join)
        opened.callback(server.shutdown, socket.SHUT_RDWR)
        with (
            pytest.raises(WorkFailed, match="no Dask scheduler answers there"),
            connected(f"tcp://127.0.0.1:{server.getsockname()[1]}"),
        ):
            pass
    assert peers, "nobody asked"
