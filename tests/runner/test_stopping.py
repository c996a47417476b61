"""Signals: one exception, once, and never in the middle of what belongs together."""

import os
import signal
from collections.abc import Callable

import pytest

from runner.stopping import Stopped, stops_raise, uninterrupted

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT]


def send(number: signal.Signals) -> None:
    os.kill(os.getpid(), number)


def stopped_by(body: Callable[[], None]) -> str:
    """What the body was stopped by."""
    with pytest.raises(Stopped) as caught, stops_raise():
        body()
    return str(caught.value)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_stops(number: signal.Signals) -> None:
    assert stopped_by(lambda: send(number)) == f"stopped by {number.name}; run it again to go on"


def test_a_second_signal_changes_nothing() -> None:
    done = []

    def body() -> None:
        try:
            send(signal.SIGTERM)
        finally:
            send(signal.SIGINT)
            done.append("device off")

    assert "SIGTERM" in stopped_by(body)
    assert done == ["device off"]


def test_a_signal_waits_for_what_belongs_together() -> None:
    done = []

    def body() -> None:
        with uninterrupted():
            with uninterrupted():
                send(signal.SIGINT)
                done.append("stored")
            done.append("known")
        done.append("too late")

    assert "SIGINT" in stopped_by(body)
    assert done == ["stored", "known"]


def test_an_error_of_the_body_is_not_hidden_by_a_signal() -> None:
    def body() -> None:
        with uninterrupted():
            send(signal.SIGINT)
            raise OSError("the disk is full")

    with pytest.raises(OSError, match="the disk is full"), stops_raise():
        body()


def test_handlers_are_as_before_afterwards() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with stops_raise():
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before
