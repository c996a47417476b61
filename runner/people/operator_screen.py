"""The operator's screen: a whole terminal, drawn by a thread of its own.

The session hands over what is to be shown and goes on: neither drawing nor a terminal that does not
take its output delays a stop.
"""

import io
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rich.cells import cell_len
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from device.drivers.driver import Reading
from device.errors import UNKNOWN
from device.force_channel.recording import Forces
from protocol.journal.records import LIFTED_N
from runner.people.operator_console import (
    DRY_RUN,
    EMERGENCY,
    EXPLAINED,
    IN_WINDOW,
    STOP_KEYS,
    TYPES,
    TYPING,
    Frame,
    Picture,
)
from runner.people.terminal import TerminalGone, visible
from runner.screens import Aim, OperatorView, PlanUnit, said_of

REDRAW_S = 0.1
"""Longest time between two drawings; the age of a reading and the clock go on by themselves."""
REST_S = 0.04
"""Shortest time between two, so that drawing leaves the processor to the session."""
# A terminal that takes no output would otherwise keep the program from ending.
ENDS_WITHIN_S = 1.0
STALE_S = 1.0
"""A reading that is older is shown as such."""
ECHO_S = 8.0
"""How long the last message stands in a place of its own; it stays in the log."""
_BESIDE_A_BAR = 53
"""Columns for the label, the figure and the remark of a bar."""
_SHORTEST_BAR, _LONGEST_BAR = 8, 50
_MEASURE = Console(file=io.StringIO())
"""Needed by rich to wrap a text; nothing is printed on it."""


@dataclass
class LiveDisplay:
    """The terminal's whole screen.

    `reading` and `forces` return what the device said last, without asking it. A `picture` stands
    in the place of bars, plan and log.
    """

    reading: Callable[[], Reading | None]
    forces: Callable[[], Forces | None] = lambda: None
    picture: Picture | None = None

    def __post_init__(self) -> None:
        self._began_s = self._said_s = time.monotonic()
        self._frame: Frame | None = None
        self._wake = threading.Event()
        self._ended = False
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._draw, name="operator's screen", daemon=True)

    def __enter__(self) -> "LiveDisplay":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the screen; a terminal that does not take it is left to the thread."""
        self._ended = True
        self._wake.set()
        self._thread.join(ENDS_WITHIN_S)

    def show(self, frame: Frame) -> None:
        """Have `frame` drawn; raise `TerminalGone` if the terminal was closed.

        Whatever else ended the drawing is raised, too: nobody watches a screen that stands still.
        """
        if isinstance(self._error, OSError):
            raise TerminalGone from self._error
        if self._error is not None:
            raise self._error
        if self._frame is None or len(frame.messages) > len(self._frame.messages):
            self._said_s = time.monotonic()
        # One assignment: the thread sees either the old frame or the new one, without a lock.
        self._frame = frame
        self._wake.set()

    @property
    def messages(self) -> tuple[str, ...]:
        return tuple(" ".join(entry) for entry in self._frame.messages) if self._frame else ()

    def _draw(self) -> None:
        # A file of its own: standard output must stay usable while the terminal takes nothing.
        try:
            with open(  # noqa: PTH123 - a descriptor, not a path
                os.dup(sys.stdout.fileno()), "w", encoding="utf-8", errors="replace"
            ) as file:
                console = Console(file=file, force_terminal=True)
                self._draw_on(console)
        # Raised by the next `show`: nobody must watch a screen that stands still.
        except Exception as error:
            self._error = error

    def _draw_on(self, console: Console) -> None:
        calls = 0
        live = Live(
            console=console,
            screen=True,
            auto_refresh=False,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        with live:
            while not self._ended:
                self._wake.wait(REDRAW_S)
                self._wake.clear()
                if (frame := self._frame) is None:
                    continue
                # Only for a new call; an answer sets the count back to 0.
                if frame.calls > calls:
                    console.bell()
                calls = frame.calls
                live.update(Group(*self._lines(frame, console)), refresh=True)
                time.sleep(REST_S)

    def _lines(self, frame: Frame, console: Console) -> list[Text]:
        now_s = time.monotonic()
        moment = Instant(
            reading=self.reading(),
            now_s=now_s,
            said_s=self._said_s,
            elapsed_s=now_s - self._began_s,
            clock=time.strftime("%H:%M:%S"),
            until=time.strftime("%H:%M", time.localtime(time.time() + frame.view.left_s)),
            forces=self.forces(),
        )
        return screen_lines(frame, moment, console.width, console.height, self.picture)


@dataclass(frozen=True, kw_only=True)
class Instant:
    """What changes on the screen by itself: the device's last reading, and the time."""

    reading: Reading | None
    now_s: float
    said_s: float
    """When the last message came."""
    elapsed_s: float
    clock: str
    until: str
    forces: Forces | None = None

    @property
    def age_s(self) -> float:
        return self.now_s - self.reading.at_s if self.reading else 0.0


def screen_lines(
    frame: Frame, moment: Instant, width: int, height: int, picture: Picture | None = None
) -> list[Text]:
    """Return exactly `height` lines: each thing has its place, whatever else is shown.

    What matters most stands at the top and at the bottom; a low terminal loses the middle.
    """
    top = [_title(frame.view, moment, width), _output(frame.view, moment, width)]
    bottom = [_alert(frame), *_question(frame, moment, width), *_keys(frame, width)]
    room = max(height - len(top) - len(bottom), 0)
    facts = _facts(frame, moment)
    body = [*_bars(frame.view, moment, width), *facts]
    if picture is not None and not frame.help:
        shown = picture(width - 1, max(room - len(facts), 0))
        body = [*(Text(f" {visible(line)}") for line in shown), *facts]
    elif room < len(body) + 2:
        body = _help_lines(frame.view.unit) if frame.help else body
    elif frame.help:
        body += [_rule("keys", width), *_help_lines(frame.view.unit)]
    else:
        body += _plan_and_log(frame, width, room - len(body))
    body += [Text()] * (room - len(body))
    lines = [*top, *body[:room], *bottom][-max(height, 1) :]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines


def _title(view: OperatorView, moment: Instant, width: int) -> Text:
    what = DRY_RUN if view.kind == "rehearsal" else ""
    left = f" {visible(view.session)}  {what}"
    right = f"{moment.clock} "
    space = " " * (width - cell_len(left) - cell_len(right))
    style = "bold white on magenta" if what else "bold white on blue"
    return Text(f"{left}{space}{right}", style=style)


def _output(view: OperatorView, moment: Instant, width: int) -> Text:
    state, style = _output_state(view, moment.reading)
    left = Text.assemble((f" {state} ", style), visible(view.place.removeprefix(view.session)))
    if moment.reading is None:
        return left
    age = Text(f"read {moment.age_s:.1f} s ago ")
    if moment.age_s > STALE_S:
        age.stylize("bold red")
    left.truncate(max(width - len(age) - 1, 0), overflow="ellipsis")
    return left + Text(" " * (width - left.cell_len - len(age))) + age


def _output_state(view: OperatorView, reading: Reading | None) -> tuple[str, str]:
    if view.unknown:
        # Before all else: once it was unknown, no reading makes it known again.
        return UNKNOWN.upper(), "bold white on red"
    if view.busy:
        return f"OUTPUT ON, {view.busy}", "bold white on red"
    if reading is None:
        return "OUTPUT NOT KNOWN YET", "bold red"
    return ("OUTPUT ON", "bold white on red") if reading.output else ("OUTPUT OFF", "bold green")


def _bars(view: OperatorView, moment: Instant, width: int) -> list[Text]:
    """Return a line each for amplitude, frequency, monitor, force and place, and for friction."""
    reading, aim, rig = moment.reading, view.aim, view.rig
    driven = reading if reading is not None and reading.output else None
    amplitude_v = driven.amplitude_v if driven else None
    force_n, position_m = _finger(view, moment)
    middle_hz = view.resonance_hz or rig.nominal_resonance_hz
    volts = Scale(0.0, rig.max_voltage_v, "{:.0f} V", [aim.voltage_v] if aim else [])
    ends_hz = (0.95 * middle_hz, 1.05 * middle_hz)
    hertz = Scale(*ends_hz, "{:.0f} Hz", [aim.frequency_hz] if aim else [])
    newtons = Scale(0.0, 2 * aim.force_n if aim else 1.0, "{:.2f} N", [aim.force_n] if aim else [])
    places = Scale(0.0, 100.0, "{:.0f} mm", [1e3 * end for end in aim.path_m] if aim else [])
    limits = (f"limit {rig.max_voltage_v:g} V", f"limit {rig.max_frequency_hz / 1e3:g} kHz", "")
    rows = [
        ("amplitude", amplitude_v, limits[0], volts),
        ("frequency", driven.frequency_hz if driven else None, limits[1], hertz),
        ("monitor", reading.monitor_v if reading else None, limits[2], volts),
        ("force", force_n, _advice(aim, force_n), newtons),
        ("place", None if position_m is None else 1e3 * position_m, "", places),
    ]
    if view.records:
        rows.append(("friction", _friction(view, moment.forces), "", Scale(0.0, 2.0, "{:.2f}", [])))
    bar = min(max(width - _BESIDE_A_BAR, _SHORTEST_BAR), _LONGEST_BAR)
    lines = [_row(*row, bar) for row in rows]
    if view.blind:  # the driver refuses what is not as commanded
        said = "-" if amplitude_v is None else "as commanded"
        lines[:3] = [Text(f" {label:<10}{said:<16}{limit}") for label, _, limit, _ in rows[:3]]
    if view.track is not None:
        lines.append(Text(f" {'track':<10}{visible(view.track) or '-'}"))
    return lines


def _finger(view: OperatorView, moment: Instant) -> tuple[float | None, float | None]:
    """Return the finger's force and place during a touch; without a finger there is no place."""
    reading, forces, force_n, position_m = moment.reading, moment.forces, None, None
    # The recorded forces are newer than those of a poll, and their zero is subtracted.
    if view.aim and forces:
        force_n, position_m = forces.normal_n - view.zero_n[1], forces.position_m
    # An old force would advise the participant wrongly.
    elif view.aim and reading and moment.now_s - (reading.finger_s or 0.0) < STALE_S:
        force_n, position_m = reading.force_n, reading.position_m
    return force_n, None if force_n is None or force_n < LIFTED_N else position_m


def _friction(view: OperatorView, forces: Forces | None) -> float | None:
    """Return the friction coefficient; it would tell a blind operator of the drive."""
    if forces and view.aim and not view.blind:
        normal_n = forces.normal_n - view.zero_n[1]
        if normal_n >= LIFTED_N:
            return (forces.tangential_n - view.zero_n[0]) / normal_n
    return None


def _advice(aim: Aim | None, force_n: float | None) -> str:
    if aim is None or force_n is None:
        return ""
    low_n, high_n = aim.force_range_n
    if force_n < LIFTED_N:
        return "no finger"
    if force_n < low_n:
        return "press harder"
    return "press less" if force_n > high_n else "good"


class Scale(NamedTuple):
    """The ends of a bar, how its figures are written, and the targets on it."""

    low: float
    high: float
    form: str
    targets: Sequence[float]


def _row(label: str, value: float | None, remark: str, scale: Scale, length: int) -> Text:

    def written(figure: float) -> str:
        return scale.form.format(figure).replace("-0 ", "0 ")

    def cell(figure: float) -> int:
        share = (figure - scale.low) / (scale.high - scale.low)
        return min(max(int(share * length), 0), length - 1)

    filled = 0 if value is None else cell(value) + (value > scale.low)
    bar = Text("━" * filled, "cyan") + Text("─" * (length - filled), "dim")
    for at in map(cell, scale.targets):
        bar = bar[:at] + Text("┃", "bold yellow") + bar[at + 1 :]
    figure = "-" if value is None else written(value)
    aims = " to ".join(dict.fromkeys(map(written, scale.targets)))
    remarks = ", ".join(filter(None, [aims and f"target {aims}", remark]))
    return Text.assemble(f" {label:<10}", bar, (f" {figure:>9}", "bold"), f"  {remarks}")


def _facts(frame: Frame, moment: Instant) -> list[Text]:
    view = frame.view
    until = f"until {moment.until}" if view.left_s > 0 else ""
    minutes, seconds = divmod(int(moment.elapsed_s), 60)
    course = [view.progress(), until, f"{minutes}:{seconds:02d} so far"]
    if view.beam:
        course.append(f"beam '{visible(view.beam)}'")
    device = [
        visible(view.identity),
        f"resonance {view.resonance_hz:.0f} Hz" if view.resonance_hz else "",
        f"{view.kept_by} {view.rig.watchdog_s:g} s" if view.kept_by else "no watchdog",
    ]
    minutes, seconds = divmod(int(moment.now_s - frame.page_s), 60)
    page = [f"participant: {visible(frame.page)}, for {minutes}:{seconds:02d}"] * bool(frame.page)
    if page and frame.window is not None:
        page.append("keys: " + ("the window" if frame.window.has_keys else "elsewhere"))
    told = (course, device, page) if page else (course, device)
    return [Text(" " + "   ".join(filter(None, facts))) for facts in told]


def _plan_and_log(frame: Frame, width: int, rows: int) -> list[Text]:
    """Return a heading and `rows` - 1 lines: the plan on the left, the messages on the right."""
    left_width = 11 * width // 20
    plan = _plan(frame.view, rows - 1, left_width)
    log = _log(frame.messages, width - left_width - 2, rows - 1)
    lines = [_rule("plan", left_width) + Text("┬", "dim") + _rule("log", width - left_width - 1)]
    for number in range(rows - 1):
        left, right = (part[number] if number < len(part) else Text() for part in (plan, log))
        left.truncate(left_width, overflow="ellipsis", pad=True)
        lines.append(left + Text("│ ", "dim") + right)
    return lines


def _rule(name: str, width: int) -> Text:
    return Text(f"─ {name} {'─' * (width - len(name) - 3)}", "dim")


def _plan(view: OperatorView, rows: int, width: int) -> list[Text]:
    """Return the trials around the running one, with ticks and answers, which are never cut."""
    lines: list[Text] = []
    for number, trial in enumerate(view.plan, start=1):
        is_next = not view.trial and trial.answer is None and trial.label == view.next_trial
        mark, style = ("✓", "green") if trial.answer is not None else (" ", "")
        if trial.running or (is_next and not any(line.style == "bold" for line in lines)):
            mark, style = "▶", "bold"
        answer = "" if trial.answer is None else f": {trial.answer}"
        line = Text(f" {mark} {number:>2} {visible(trial.label)}", style)
        # The name of a trial is cut, because the answer is what the operator looks for.
        line.truncate(max(width - cell_len(visible(answer)), 0), overflow="ellipsis")
        lines.append(line.append(visible(answer)))
    at = next((number for number, line in enumerate(lines) if line.style == "bold"), len(lines))
    first = min(max(at - rows // 2, 0), max(len(lines) - rows, 0))
    return lines[first : first + rows]


def _log(messages: Iterable[tuple[str, str]], width: int, rows: int) -> list[Text]:
    """Return the last messages, wrapped, oldest first."""
    lines = [
        Text(f"{at if number == 0 else '':<9}{part}")
        for at, message in messages
        for number, part in enumerate(_wrapped(visible(message), max(width - 9, 8)))
    ]
    return lines[-rows:] if rows > 0 else []


def _alert(frame: Frame) -> Text:
    """Return what stays until it is over: calls, a pause."""
    alerts = Text(" ")
    if frame.calls:
        times = "" if frame.calls == 1 else f" ({frame.calls} times)"
        alerts.append(f" PARTICIPANT CALLS{times}: press a ", "bold black on yellow")
        alerts.append(" ")
    if frame.window is not None and not frame.window.is_shown:
        alerts.append(" THE PARTICIPANT'S WINDOW IS MINIMISED ", "bold white on red")
        alerts.append(" ")
    elif frame.window is not None and frame.types and not frame.window.has_keys:
        alerts.append(" THE PARTICIPANT CANNOT TYPE: click the window ", "bold black on yellow")
        alerts.append(" ")
    if frame.view.state == "paused":
        alerts.append(" PAUSED: p continues ", "bold black on cyan")
    elif frame.pausing:
        alerts.append(f" PAUSE after this {frame.view.unit}: p cancels ", "bold black on cyan")
    return alerts


def _question(frame: Frame, moment: Instant, width: int) -> list[Text]:
    """Return the question, the note being typed or a new message, in at least two lines."""
    text = frame.question
    if frame.typed is not None:
        text = f"{text or f'{frame.typing}:'} {frame.typed}_"
    elif not text and frame.messages and moment.now_s < moment.said_s + ECHO_S:
        text = frame.messages[-1][1]
    style = "bold" if frame.question or frame.typed is not None else "yellow"
    lines = [Text(f" {line}", style) for line in _wrapped(visible(text), max(width - 2, 8))]
    # At least two, so that nothing above jumps when a question comes.
    return [*lines, Text(), Text()][: max(len(lines), 2)]


def _keys(frame: Frame, width: int) -> list[Text]:
    in_window = frame.window is not None and frame.window.has_keys
    stop = Text(f" {IN_WINDOW} ", "bold white on red") if in_window else Text()
    if frame.typed is not None:
        return [stop, *_legend(TYPING, width)]
    if not in_window:
        stop = Text(f" {TYPES if frame.types else STOP_KEYS}", "bold red")
    keys = [f"{key} {said_of(frame.view.unit, short)}" for key, short, _ in EXPLAINED]
    return [*_legend(keys, width), stop]


def _legend(keys: Iterable[str], width: int) -> list[Text]:
    """Return `keys` in lines; none is broken over two."""
    lines = [""]
    for key in keys:
        if lines[-1] and len(lines[-1]) + 3 + len(key) > width - 1:
            lines.append("")
        lines[-1] += ("   " if lines[-1] else "") + key
    return [Text(f" {line}", "dim") for line in lines]


def _help_lines(unit: PlanUnit) -> list[Text]:
    keys = [(key, said_of(unit, long)) for key, _, long in EXPLAINED]
    return [Text(f" {key:<18}{long}") for key, long in [*keys, ("e, space, Ctrl-E", EMERGENCY)]]


def _wrapped(text: str, width: int) -> list[str]:
    """Return `text` in lines of at most `width` columns, broken between words where possible."""
    return [line.plain.rstrip() for line in Text(text).wrap(_MEASURE, width)] if text else []
