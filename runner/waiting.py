"""Waiting, with the device kept alive, the operator heard and the participant served meanwhile."""

from collections.abc import Callable
from typing import TypeVar

from runner.orders import obey
from runner.room import Room
from runner.screens import Response
from runner.stopping import heed_stop

TICK_S = 0.05

_Thing = TypeVar("_Thing")


def awaited(room: Room, poll: Callable[[], _Thing | None]) -> _Thing:
    """Return what `poll` gives as soon as it gives something."""
    while (thing := poll()) is None:
        tick(room, TICK_S)
    return thing


def response(room: Room) -> Response:
    """Return the participant's answer to what was last shown."""
    return awaited(room, room.participant.poll)


def operator_answer(room: Room) -> str:
    """Return what the operator answers; the participant is looked after meanwhile.

    A question that is left without an answer is taken back: nothing may be done about it any more.
    """

    def poll() -> str | None:
        room.participant.poll()
        return room.operator.answered()

    try:
        return awaited(room, poll)
    except BaseException:
        room.operator.unask()
        raise


def pass_time(
    room: Room,
    seconds: float,
    meanwhile: Callable[[], None] = lambda: None,
    every_s: float = TICK_S,
) -> None:
    """Let `seconds` pass; the participant goes on touching, `meanwhile` is called `every_s`."""
    end_s = room.clock.monotonic_s() + seconds
    while (left_s := end_s - room.clock.monotonic_s()) > 1e-9:
        room.participant.poll()
        meanwhile()
        tick(room, min(every_s, left_s))
    room.participant.poll()


def tick(room: Room, seconds: float) -> None:
    """Let one tick pass.

    Raises:
        DeviceError: the device failed meanwhile.
        StoppedByOperator, RepeatTrial: the operator ordered so.
        Stopped: a signal did.
    """
    heed_stop()
    room.device.beat()
    obey(room)
    room.clock.sleep(seconds)
