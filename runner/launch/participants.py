"""The participant and the operator of a session: at the window, at the terminal, or simulated.

The participant's screen is asked for once, and kept for this computer.
"""

import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path

from device.arrays import FloatArray
from device.drivers.driver import Reading
from device.force_channel.recording import Forces
from device.friction.surfaces import length_of
from device.people.answering import given_change, is_stated
from device.people.people_file import EFFECT_EXAMPLE
from device.people.person import People, World, person_of, session_name
from protocol.errors import BadInput
from protocol.study.participant_texts import study_wording
from runner.clock import SteppedClock
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
from runner.people.terminal import at_terminal, terminal_keys, typed_answer
from runner.people.virtual_participant import (
    Finger,
    UntouchedBeam,
    VirtualAtWindow,
    VirtualParticipant,
)
from runner.screen_list import ScreenPlace, listed_screens, numbered_screens
from runner.screens import Operator, Participant, PlanUnit
from runner.session.session import Session
from runner.study.files import state_folder
from runner.window.client import WindowParticipant

Say = Callable[[str], None]
"""Prints a line."""
Watched = tuple[Callable[[], Reading | None], Callable[[], Forces | None]]
"""Return what the device said last, and the newest forces, without asking it."""


@contextmanager
def participant_and_operator(
    session: Session,
    rig: SessionRig,
    say: Say,
    window: WindowParticipant | None,
    finger: Finger | None,
    running: Callable[[], int | None],
) -> Iterator[tuple[Participant, Operator]]:
    """Yield the participant and the operator of `session`; restore the terminal afterwards.

    `finger` is what a virtual participant feels with, None if the participant is a person. It
    learns which trial is `running` (its index) only where there is no friction to feel.
    """
    swap = _swap(session, rig, finger)
    at_keys = partial(
        operator_at_terminal,
        say,
        (lambda: rig.device.reading, lambda: rig.device.forces),
        swap,
        quiet=isinstance(rig.clock, SteppedClock),
    )
    if session.slides:
        plot = SlidePlot()

        def picture(width: int, rows: int) -> list[str]:
            return plot.lines(width, rows, rig.clock.monotonic_s())

        with at_keys(picture, unit="pass", alone=rig.control is not None) as operator:
            block = SlidingBlock(
                operator=operator,
                forces=lambda: rig.device.forces,
                clock=rig.clock,
                plan=session.plan,
                load_n=session.study.touch.force_n,
                plot=plot,
                finger=rig.control,
            )
            yield block, operator
    elif finger is not None:
        assert session.virtual is not None, "a virtual participant has parameters"
        person = person_of(session.virtual)
        if rig.control is not None:
            rig.control.sensor("skin", person.skin)
            rig.control.sensor("mu0", person.mu0)
        name = session_name(session.seed, session.participant, session.number)
        unfelt = session.study.surface.kind == "given"
        if unfelt and session.virtual.effect is None and not is_stated(session.study):
            does = "rates as at rest" if session.study.absolute else "answers at random"
            say(
                "Touches do not state their friction: where it is missing the virtual participant "
                f"{does}. A people file says more: {EFFECT_EXAMPLE}"
            )
        participant: Participant = VirtualParticipant(
            finger,
            rig.clock,
            person,
            name,
            length_m=length_of(session.study.surface),
            worth=partial(_worth, session, running) if unfelt else None,
        )
        # At a real device somebody mounts the beams, unless nobody is there to ask.
        alone = rig.control is not None or not at_terminal(sys.stdin, sys.stdout)
        with at_keys(alone=alone) as operator:
            if window is not None:
                window.call_operator = operator.participant_called
                participant = VirtualAtWindow(participant, window)
            yield participant, operator
    elif window is not None:
        with at_keys() as operator:
            window.call_operator = operator.participant_called
            yield window, operator
    else:
        lines = TypedLines(sys.stdin)
        reader = ConsoleParticipant(lines, say, study_wording(session.study, session.language))
        yield reader, _operator_by_lines(lines, PlainDisplay(say, shared=True), swap)


def _worth(session: Session, running: Callable[[], int | None]) -> FloatArray:
    """Return the change that the running trial is to the virtual participant, shape (1,)."""
    index, virtual = running(), session.virtual
    assert index is not None, "a question belongs to a trial"
    assert virtual is not None, "a virtual participant has parameters"
    world, person = World(effect=virtual.effect), People.of([person_of(virtual)])
    return given_change(session.study, session.plan.trials[index], world, person)


def _swap(session: Session, rig: SessionRig, finger: Finger | None) -> Callable[[str], None]:
    if (hand := rig.control) is not None:
        return lambda beam: hand.swap_beam(session.study.beams[beam])
    return finger.mount if isinstance(finger, UntouchedBeam) else lambda _: None


def _operator_by_lines(
    lines: TypedLines, display: PlainDisplay, swap: Callable[[str], None], unit: PlanUnit = "trial"
) -> OperatorConsole:
    for line in line_help(unit):
        display.say(line)
    piped = not lines.at_terminal
    return OperatorConsole(lines.operator_typed, display, swap, lines.forget, piped=piped)


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
    """Yield an operator with keys, or lines from a pipe unless `alone` with a simulated device."""
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

    The screen shows the last reading and the `picture`, if any. If `quiet`, there is neither.
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


def participants_screen(
    touchbeam: Sequence[str], wanted: int | None, say: Say, *, windowed: bool = False
) -> int:
    """Return the participant's screen, `wanted` or chosen; `BadInput` if nobody can be asked."""
    if wanted is not None:
        return wanted
    there = listed_screens(touchbeam)
    if len(there) == 1 and not windowed:
        say(f"This computer has one screen ({there[0]}): the participant's window will cover it.")
    if len(there) < 2:
        return 0  # the window says what is wrong with a display that has none
    screen = _kept(there)
    if screen is None:
        with numbered_screens(touchbeam):
            screen = _asked(there, say)
        _keep(screen, say)
    say(f"The participant's screen is {screen}; --screen N chooses another one.")
    return screen.number


def _asked(there: Sequence[ScreenPlace], say: Say) -> ScreenPlace:
    choices = ", ".join(map(str, there))
    if not at_terminal(sys.stdin, sys.stdout):
        raise BadInput(
            f"this computer has several screens ({choices}); choose the participant's with "
            "--screen N"
        )
    say(f"Each screen shows its number ({choices}).")
    text = "Type the number of the participant's screen, then press Enter."
    try:
        return typed_answer(say, text, {str(screen.number): screen for screen in there}.get)
    except EOFError:
        raise BadInput("the participant's screen must be chosen; use --screen N") from None


def choice_file() -> Path:
    return state_folder() / "participant-screen.json"


def _kept(there: Sequence[ScreenPlace]) -> ScreenPlace | None:
    with suppress(OSError, ValueError, TypeError):
        kept = ScreenPlace(**json.loads(choice_file().read_text(encoding="utf-8")))
        return next((screen for screen in there if screen.is_same(kept)), None)
    return None


def _keep(screen: ScreenPlace, say: Say) -> None:
    try:
        choice_file().parent.mkdir(parents=True, exist_ok=True)
        choice_file().write_text(json.dumps(asdict(screen)) + "\n", encoding="utf-8")
    except OSError as error:
        say(f"warning: the choice cannot be kept ({error.strerror})")
