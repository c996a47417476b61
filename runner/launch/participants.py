"""The participant and the operator of a session: at the window, at the terminal, or simulated."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from device.drivers.driver import Reading
from device.force_channel.recording import Forces
from device.simulator.client import BeamControl, swapping
from protocol.study.participant_texts import study_wording
from runner.clock import Clock, SteppedClock
from runner.launch.device_access import SessionRig
from runner.people.operator_console import (
    Display,
    OperatorConsole,
    Picture,
    PlainDisplay,
    line_help,
)
from runner.people.participant_console import ConsoleParticipant, TypedLines
from runner.people.sliding_block import SlidePlot, SlidingBlock
from runner.people.terminal import at_terminal, terminal_keys
from runner.people.virtual_participant import UntouchedBeam, VirtualAtWindow
from runner.screens import Operator, Participant, PlanUnit
from runner.session.session import Session
from runner.window.client import WindowParticipant

if TYPE_CHECKING:
    from runner.people.virtual_participant import Finger

Say = Callable[[str], None]
"""Prints a line."""
Watched = tuple[Callable[[], Reading | None], Callable[[], Forces | None]]
"""Return what the device said last, and the newest forces, without asking it."""


@contextmanager
def participant_and_operator(
    session: Session,
    rig: SessionRig,
    clock: Clock,
    say: Say,
    window: WindowParticipant | None,
    finger: "Finger | None",
) -> Iterator[tuple[Participant, Operator]]:
    """Yield the participant and the operator of `session`; restore the terminal afterwards.

    Args:
        session: gives the study and the language.
        rig: the rig whose simulated beam is swapped and touched, if it is simulated.
        clock: the session's clock.
        say: prints a line.
        window: the participant's window, None if there is none.
        finger: what a virtual participant feels with; None if the participant is a person.
    """
    watched = (lambda: rig.device.reading, lambda: rig.device.forces)
    swap = _swap(session, rig, finger)
    if session.slides:
        with _block_and_operator(session, rig, clock, say, swap) as people:
            yield people
    elif finger is not None:
        participant = _virtual_participant(session, finger, clock, rig.control)
        # At a real device somebody mounts the beams, unless nobody is there to ask.
        alone = rig.control is not None or not at_terminal(sys.stdin, sys.stdout)
        quiet = isinstance(clock, SteppedClock)
        with keys_and_display(say, watched, quiet=quiet) as (typed, display):
            operator = OperatorConsole(typed, display, swap, alone=alone)
            if window is not None:
                window.call_operator = operator.participant_called
                participant = VirtualAtWindow(participant, window)
            yield participant, operator
    elif window is not None:
        with operator_at_terminal(say, watched, swap) as operator:
            window.call_operator = operator.participant_called
            yield window, operator
    else:
        lines = TypedLines(sys.stdin)
        wording = study_wording(session.study, session.language)
        console_participant = ConsoleParticipant(lines, say, wording)
        yield console_participant, _operator_by_lines(lines, PlainDisplay(say, shared=True), swap)


@contextmanager
def _block_and_operator(
    session: Session, rig: SessionRig, clock: Clock, say: Say, swap: Callable[[str], None]
) -> Iterator[tuple[Participant, Operator]]:
    """Yield the block of a sliding experiment and the operator, who draws it on a real device."""
    plot = SlidePlot()

    def picture(width: int, rows: int) -> list[str]:
        return plot.lines(width, rows, clock.monotonic_s())

    with operator_at_terminal(
        say,
        (lambda: rig.device.reading, lambda: rig.device.forces),
        swap,
        picture,
        unit="pass",
        alone=rig.control is not None,
        quiet=isinstance(clock, SteppedClock),
    ) as operator:
        block = SlidingBlock(
            operator=operator,
            forces=lambda: rig.device.forces,
            clock=clock,
            plan=session.plan,
            load_n=session.study.touch.force_n,
            plot=plot,
            finger=rig.control,
        )
        yield block, operator


def _swap(session: Session, rig: SessionRig, finger: "Finger | None") -> Callable[[str], None]:
    """Return what else happens when the operator is asked to mount a beam."""
    if rig.control is not None:
        return swapping(rig.control, session.study.beams)
    return finger.mount if isinstance(finger, UntouchedBeam) else lambda _: None


def _virtual_participant(
    session: Session, finger: "Finger", clock: Clock, control: BeamControl | None
) -> Participant:
    """Return the participant that the journal describes; a simulated beam gets its skin."""
    from device.people.person import person_of, session_name
    from runner.people.virtual_participant import VirtualParticipant

    assert session.virtual is not None, "a virtual participant has parameters"
    person = person_of(session.virtual)
    if control is not None:
        control.sensor("skin", person.skin)
        control.sensor("mu0", person.mu0)
    name = session_name(session.seed, session.participant, session.number)
    return VirtualParticipant(control=finger, clock=clock, person=person, name=name)


def _operator_by_lines(
    lines: TypedLines,
    display: PlainDisplay,
    swap: Callable[[str], None],
    unit: PlanUnit = "trial",
) -> OperatorConsole:
    """Return an operator who types lines, or whose lines come from a file or a program."""
    for line in line_help(unit):
        display.say(line)
    return OperatorConsole(
        lines.operator_typed, display, swap, lines.forget, piped=not lines.at_terminal
    )


@contextmanager
def operator_at_terminal(
    say: Say,
    watched: Watched,
    swap: Callable[[str], None],
    picture: Picture | None = None,
    *,
    unit: PlanUnit = "trial",
    alone: bool = False,
    quiet: bool = False,
) -> Iterator[OperatorConsole]:
    """Yield an operator who has the terminal alone: keys at a terminal, lines from a pipe.

    One who is `alone` with a simulated device is asked for nothing, and needs no pipe.
    """
    if not alone and not at_terminal(sys.stdin, sys.stdout):
        yield _operator_by_lines(TypedLines(sys.stdin), PlainDisplay(say), swap, unit)
        return
    with keys_and_display(say, watched, picture, quiet=quiet) as (typed, display):
        yield OperatorConsole(typed, display, swap, alone=alone)


@contextmanager
def keys_and_display(
    say: Say, watched: Watched, picture: Picture | None = None, *, quiet: bool = False
) -> Iterator[tuple[Callable[[bool], str], Display]]:
    """Yield the operator's keys and display: a screen at a terminal, plain lines elsewhere.

    The screen shows the device's last reading and the `picture`, if there is one. If `quiet`,
    display nothing and read no keys.
    """
    if quiet or not at_terminal(sys.stdin, sys.stdout):
        yield lambda _: "", PlainDisplay((lambda _: None) if quiet else say)
        return
    with terminal_keys() as typed:
        if os.environ.get("TERM") in {"dumb", "unknown"}:  # it cannot be drawn on
            yield typed, PlainDisplay(say)
            return
        from runner.people.operator_screen import LiveDisplay

        display = LiveDisplay(*watched, picture)
        try:
            with display:
                yield typed, display
        finally:
            for message in display.messages:  # they stay on the terminal
                say(message)
