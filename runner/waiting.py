"""Waiting, with the device kept alive and watched meanwhile."""

from collections.abc import Callable
from typing import TypeVar

from runner.ports import Clock, Device, Participant
from runner.screens import Response

TICK_S = 0.05

_Thing = TypeVar("_Thing")


def awaited(poll: Callable[[], _Thing | None], device: Device, clock: Clock) -> _Thing:
    """Return what `poll` gives as soon as it gives something."""
    while (thing := poll()) is None:
        device.beat()
        clock.sleep(TICK_S)
    return thing


def response(participant: Participant, device: Device, clock: Clock) -> Response:
    """Return the participant's answer to what was last shown."""
    return awaited(participant.poll, device, clock)


def pass_time(seconds: float, participant: Participant, device: Device, clock: Clock) -> None:
    """Let `seconds` pass; the participant goes on touching."""
    end_s = clock.monotonic_s() + seconds
    while (left_s := end_s - clock.monotonic_s()) > 1e-9:
        device.beat()
        participant.poll()
        clock.sleep(min(TICK_S, left_s))
    participant.poll()
