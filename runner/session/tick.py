"""Waiting, with the device kept alive, the operator heard and the participant served meanwhile."""

from collections.abc import Callable
from typing import TypeVar

from device.drivers.setpoints import ReadBack
from protocol.errors import WorkFailed
from protocol.plan.trials import Trial, trial_s
from runner.screens import Instruction, Note, Notice, Response, View
from runner.session.session import Room
from runner.signals import heed_stop


class StoppedByOperator(WorkFailed):
    """The operator ended the session; it can be resumed."""


class RepeatTrial(Exception):
    """The operator wants the trial that is running again."""


def obey(room: Room) -> None:
    """Do what the operator has ordered, if anything.

    Raises:
        StoppedByOperator: the session is to end here; after an emergency stop the output is off.
        RepeatTrial: the trial is to be done again.
    """
    match room.operator.order():
        case "emergency stop":
            room.device.emergency_stop()
            raise StoppedByOperator("emergency stop")
        case "stop":
            raise StoppedByOperator("stopped by the operator")
        case "repeat" if room.log.state.trial is not None:
            raise RepeatTrial
        case "repeat":
            room.operator.tell("no trial is running that could be repeated")
        case "pause":
            room.pause_wanted = not room.pause_wanted
            room.operator.tell(
                "a pause comes before the next trial" if room.pause_wanted else "no pause"
            )
        case Note(text=text):
            room.log.append("note", text=text)


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


def show_where_we_are(
    room: Room,
    device: ReadBack | None = None,
    warning: str = "",
    *,
    searching: bool = False,
    unknown: bool = False,
) -> None:
    """Show the operator where the session stands, and what `device` read back, if it is on."""
    state, session = room.log.state, room.session
    left = [entry for entry in session.plan.trials if entry.index not in state.answered]
    running = [entry for entry in left if entry.index == state.trial]
    coming = [entry for entry in left if entry.index != state.trial]
    room.operator.see(
        View(
            session=f"{session.participant}/{session.number}",
            kind=session.kind,
            state=state.name,
            trial=_named(running),
            next_trial=_named(coming),
            done=len(state.answered),
            total=len(session.plan.trials),
            left_s=sum(trial_s(session.study, entry) for entry in left),
            device=device,
            searching=searching,
            watchdog_s=session.study.rig.watchdog_s,
            last_answer=state.last_answer,
            warning=warning,
            unknown=unknown,
        )
    )


def pause_if_wanted(room: Room, trial: Trial) -> None:
    """Keep the pause before `trial`: the study's own, a break, and the operator's."""
    pass_time(room, room.session.study.timing.inter_trial_s)
    if trial.break_s > 0:
        room.participant.show(Notice(text="break"))
        pass_time(room, trial.break_s)
        room.participant.show(Instruction(text="break"))
        response(room)
    if room.pause_wanted:
        _pause(room)


def _pause(room: Room) -> None:
    room.log.append("paused")
    room.participant.show(Notice(text="pause"))
    show_where_we_are(room)
    while room.pause_wanted:
        room.participant.poll()
        tick(room, TICK_S)
    room.log.append("unpaused")


def _named(trials: list[Trial]) -> str:
    """What the operator calls the first of `trials`."""
    return (trials[0].condition or trials[0].kind) if trials else "-"
