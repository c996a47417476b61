"""What the operator is shown, and pauses."""

from device.records import ReadBack
from protocol.durations import trial_s
from protocol.trial import Trial
from runner.room import Room
from runner.screens import Instruction, Notice
from runner.view import View
from runner.waiting import TICK_S, pass_time, response, tick


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
