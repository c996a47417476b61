"""Predictions made aside: the same numbers, the same errors, and no process left behind."""

import errno
import os
import pickle
import threading
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import pytest

from device.errors import OutOfRangeError
from device.friction.changes import Change, Moment
from runner.study import model_process as module
from runner.study.model_process import contrasts, foretelling

RESTING = Moment(
    voltage_v=0.0,
    frequency=1.0,
    direction="right",
    coverage="local",
    force_n=0.5,
    contact_m=0.01,
    sliding_speed_m_s=0.04,
    has_bodies=True,
)
DRIVEN = Change(
    effect="friction",
    contrary=False,
    before=RESTING,
    after=replace(RESTING, voltage_v=100.0),
    places_m=(0.0414,),
)
STRONGER = replace(DRIVEN, after=replace(RESTING, voltage_v=200.0))
OFF_THE_BEAM = replace(DRIVEN, places_m=(9.0,))


# Other tests have left idle threads, numpy's and their own, that no command has when it begins.
pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")


@pytest.fixture
def forked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The processes that are forked."""
    fork, found = os.fork, []

    def noted() -> int:
        process = fork()
        found.append(process)
        return process

    monkeypatch.setattr(os, "fork", noted)
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    return found


def _gone(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


def test_the_answer_is_that_of_this_process(forked: list[int]) -> None:
    with foretelling() as told:
        found = told([DRIVEN, STRONGER])
    assert found == contrasts([DRIVEN, STRONGER])
    assert found[1] > found[0] > 0
    assert [_gone(process) for process in forked] == [True]


def test_nobody_asks_and_nothing_stays(forked: list[int]) -> None:
    with foretelling():
        pass
    assert [_gone(process) for process in forked] == [True]


def test_the_body_fails_and_nothing_stays(forked: list[int]) -> None:
    with pytest.raises(LookupError, match="the body's own"), foretelling():
        raise LookupError("the body's own")
    assert [_gone(process) for process in forked] == [True]


def test_a_process_that_dies_is_stood_in_for(
    monkeypatch: pytest.MonkeyPatch, forked: list[int]
) -> None:
    here, load = os.getpid(), module._model

    def loaded_here_alone() -> object:
        if os.getpid() != here:
            os._exit(1)
        return load()

    monkeypatch.setattr(module, "_model", loaded_here_alone)
    with foretelling() as told:
        os.waitid(os.P_PID, forked[0], os.WEXITED | os.WNOWAIT)
        assert told([DRIVEN]) == contrasts([DRIVEN])


def test_an_answer_cut_short_is_made_here_again(
    monkeypatch: pytest.MonkeyPatch, forked: list[int]
) -> None:
    here, dump = os.getpid(), pickle.dump

    def cut_short_elsewhere(what: object, file: BinaryIO) -> None:
        if os.getpid() == here:
            return dump(what, file)
        file.write(pickle.dumps(what)[:-3])
        file.flush()
        os._exit(1)

    monkeypatch.setattr(pickle, "dump", cut_short_elsewhere)
    with foretelling() as told:
        assert told([DRIVEN]) == contrasts([DRIVEN])
    assert [_gone(process) for process in forked] == [True]


def test_what_the_model_refuses_is_said_here(
    forked: list[int], capfd: pytest.CaptureFixture[str]
) -> None:
    with (
        pytest.raises(OutOfRangeError, match=r"x_m must lie in \[0, 0\.1\], got 9"),
        foretelling() as told,
    ):
        told([OFF_THE_BEAM])
    assert capfd.readouterr().err == ""
    assert [_gone(process) for process in forked] == [True]


def test_beside_another_thread_nothing_is_forked(
    forked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(threading, "active_count", lambda: 2)
    with foretelling() as told:
        assert told([DRIVEN]) == contrasts([DRIVEN])
    assert forked == []


@pytest.mark.parametrize("call", ["pipe", "fork"])
def test_where_nothing_can_be_forked_the_answer_is_made_here(
    monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    def refused() -> None:
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

    before = len(list(Path("/proc/self/fd").glob("*")))
    with monkeypatch.context() as patched:
        patched.setattr(threading, "active_count", lambda: 1)
        patched.setattr(os, call, refused)
        with foretelling() as told:
            assert told([DRIVEN]) == contrasts([DRIVEN])
    after = len(list(Path("/proc/self/fd").glob("*")))
    assert after == before, "no pipe is left open"
