"""The operator's screen: what stands where, on wide, narrow and low terminals."""

import io
import os
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console, Group

from device.drivers.driver import Reading
from device.force_channel.recording import Forces
from runner.people.operator_console import IN_WINDOW, STOP_KEYS, TYPES, Frame
from runner.people.operator_screen import Instant, LiveDisplay, screen_lines
from runner.people.terminal import TerminalGone, visible
from runner.screens import Aim, PlanLine, WindowState
from tests.runner.views import plan, view

SIZES = [(80, 24), (120, 40), (60, 20), (30, 16), (10, 3), (200, 60)]
AIM = Aim(
    voltage_v=200,
    frequency_hz=24_068,
    path_m=(0.010, 0.081),
    force_n=0.5,
    force_range_n=(0.25, 0.75),
)
ON = Reading(
    at_s=99.9,
    output=True,
    amplitude_v=123.0,
    frequency_hz=24_068.0,
    monitor_v=121.0,
    force_n=0.2,
    position_m=0.033,
    finger_s=99.9,
)


def moment(reading: Reading | None = ON, now_s: float = 100.0) -> Instant:
    return Instant(
        reading=reading, now_s=now_s, said_s=99.0, elapsed_s=250, clock="14:03:22", until="14:05"
    )


def lines(frame: Frame, now: Instant | None = None, width: int = 80, height: int = 24) -> list[str]:
    return [line.plain for line in screen_lines(frame, now or moment(), width, height)]


def row(found: list[str], label: str) -> str:
    return next(line for line in found if line.startswith(f" {label}"))


def test_the_bars_show_what_was_read_with_targets_and_limits() -> None:
    found = lines(Frame(view=view(aim=AIM)))
    assert re.search(r"━+─+┃ +123 V  target 200 V, limit 200 V$", row(found, "amplitude"))
    assert re.search(r"24068 Hz  target 24068 Hz, limit 40 kHz$", row(found, "frequency"))
    assert re.search(r" 121 V  target 200 V$", row(found, "monitor"))
    assert re.search(r" 0.20 N  target 0.50 N, press harder$", row(found, "force"))
    assert re.search(r" 33 mm  target 10 mm to 81 mm$", row(found, "place"))
    assert "OUTPUT ON  touching: voltage" in found[1]
    assert found[1].rstrip().endswith("read 0.1 s ago")


def test_a_blind_operator_sees_that_the_output_is_on_and_no_figure_of_the_drive() -> None:
    found = lines(Frame(view=view(aim=AIM, blind=True)))
    assert "OUTPUT ON" in found[1]
    for label, limit in (("amplitude", "limit 200 V"), ("frequency", "limit 40 kHz")):
        assert re.search(rf"as commanded +{limit}$", row(found, label))
    assert row(found, "monitor").split() == ["monitor", "as", "commanded"]
    assert "0.20 N  target 0.50 N, press harder" in row(found, "force")
    assert not re.search("123|121|target 200", "\n".join(found))


FELT = Forces(at_s=99.9, tangential_n=0.26, normal_n=0.45, position_m=0.05)


def test_friction_is_shown_while_a_touch_is_recorded() -> None:
    recording = view(aim=AIM, records=True, zero_n=(0.02, 0.05))
    found = lines(Frame(view=recording), replace(moment(), forces=FELT))
    assert re.search(r"━─+ +0\.60 *$", row(found, "friction"))
    assert " 0.40 N  target 0.50 N, good" in row(found, "force")
    assert " 50 mm" in row(found, "place")


@pytest.mark.parametrize(
    ("shown", "forces"),
    [
        ({"aim": AIM}, None),
        ({"aim": None}, FELT),
        ({"aim": AIM, "zero_n": (0.0, 0.44)}, FELT),
        ({"aim": AIM, "blind": True}, FELT),
    ],
    ids=["not yet", "no touch", "no finger", "blind"],
)
def test_friction_is_not_shown_where_it_says_nothing_or_too_much(
    shown: dict[str, Any], forces: Forces | None
) -> None:
    found = lines(Frame(view=view(records=True, **shown)), replace(moment(), forces=forces))
    assert row(found, "friction").split()[-1] == "-"


def test_a_study_that_records_nothing_has_no_line_of_friction() -> None:
    assert not any(line.startswith(" friction") for line in lines(Frame(view=view(aim=AIM))))


@pytest.mark.parametrize(
    ("force_n", "advice"),
    [(0.01, "no finger"), (0.1, "press harder"), (0.3, "good"), (0.8, "press less")],
)
def test_the_force_comes_with_advice(force_n: float, advice: str) -> None:
    reading = Reading(**{**vars(ON), "force_n": force_n})
    assert row(lines(Frame(view=view(aim=AIM)), moment(reading)), "force").endswith(advice)


@pytest.mark.parametrize(
    ("kept_by", "said"),
    [("watchdog", "watchdog 0.5 s"), ("guardian", "guardian 0.5 s"), ("", "no watchdog")],
)
def test_what_turns_off_a_silent_programs_output_is_said(kept_by: str, said: str) -> None:
    (facts,) = [line for line in lines(Frame(view=view(kept_by=kept_by))) if said in line]
    assert facts.endswith(said)


def test_an_old_reading_is_shown_with_its_age() -> None:
    old = screen_lines(Frame(view=view(aim=AIM)), moment(now_s=103.4), 80, 24)[1]
    assert old.plain.rstrip().endswith("read 3.5 s ago")
    assert any("red" in str(span.style) and span.end >= 78 for span in old.spans)
    finger = row(lines(Frame(view=view(aim=AIM)), moment(now_s=103.4)), "force")
    assert " -  target 0.50 N" in finger


@pytest.mark.parametrize(
    ("reading", "changes", "shown"),
    [
        (None, {"state": "idle"}, "OUTPUT NOT KNOWN YET"),
        (ON, {"unknown": True}, "OUTPUT STATE UNKNOWN - CUT THE AMPLIFIER"),
        (ON, {"busy": "10 V at most, searching"}, "OUTPUT ON, 10 V at most, searching"),
        (Reading(**{**vars(ON), "output": False}), {}, "OUTPUT OFF"),
    ],
)
def test_the_output_is_off_only_if_it_was_read_as_off(
    reading: Reading | None, changes: dict[str, object], shown: str
) -> None:
    output = lines(Frame(view=view(**changes)), moment(reading))[1]
    assert shown in output
    assert ("OFF" in output) == (shown == "OUTPUT OFF")


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_screen_is_filled_and_nothing_is_too_wide(width: int, height: int) -> None:
    frame = Frame(view=view(aim=AIM), question="Mount the beam '1 mm', then press Enter.")
    found = screen_lines(frame, moment(), width, height)
    assert len(found) == height
    assert max(line.cell_len for line in found) <= width
    terminal = Console(file=io.StringIO(), width=width, height=height, force_terminal=True)
    assert len(terminal.render_lines(Group(*found))) == height


def test_a_long_condition_is_cut_and_its_score_is_not() -> None:
    long = PlanLine(label="voltage with a slow rise, catch", answer="no change, score 10")
    shown = lines(Frame(view=replace(view(), plan=(long,))))
    assert any("voltage with a s…: no change, score 10│" in line for line in shown), shown


@pytest.mark.parametrize(("width", "height"), SIZES[:4])
def test_nothing_moves_whatever_is_shown(width: int, height: int) -> None:
    quiet = Frame(view=view())
    busy = Frame(
        view=view(aim=AIM, warning="no watchdog"),
        messages=(("14:03:21", "noted: skin dry"),) * 50,
        calls=2,
        pausing=True,
    )
    first, second = (lines(frame, None, width, height) for frame in (quiet, busy))
    for label in ("amplitude", "force", "EMERGENCY STOP"):
        assert first.index(row(first, label)) == second.index(row(second, label))


@pytest.mark.parametrize(("width", "height"), SIZES[:4])
def test_what_matters_stands_on_every_terminal(width: int, height: int) -> None:
    frame = Frame(view=view(aim=AIM), question="Mount the beam '1 mm', then press Enter.", calls=1)
    text = " ".join(" ".join(lines(frame, None, width, height)).split())
    for needed in ("OUTPUT ON", "123 V", "Mount the beam", "EMERGENCY STOP", "PARTICIPANT CALLS"):
        assert needed in text


def test_a_dry_run_looks_like_one() -> None:
    title = screen_lines(Frame(view=view(kind="rehearsal")), moment(), 80, 24)[0]
    session = screen_lines(Frame(view=view()), moment(), 80, 24)[0]
    assert "DRY RUN: a rehearsal, no participant's data" in title.plain
    assert "DRY RUN" not in session.plain
    assert title.style != session.style


def test_the_plan_has_ticks_answers_and_the_running_trial() -> None:
    found = "\n".join(lines(Frame(view=view()), None, 120, 40))
    assert "✓  3 frequency: stronger, score 8" in found
    assert "▶  4 voltage" in found
    assert "   5 pressure" in found
    for fact in ("touchbeam,BOARD,SIM,1.1", "resonance 24068 Hz", "4:10 so far", "until 14:05"):
        assert fact in found
    between = "\n".join(lines(Frame(view=view(plan=plan(7)[:-1]))))
    assert "▶" not in between


def test_the_log_keeps_the_last_messages() -> None:
    messages = tuple(("14:03:21", f"message {number}") for number in range(50))
    found = "\n".join(lines(Frame(view=view(), messages=messages)))
    assert "message 49" in found
    assert "message 42" in found
    assert "message 3 " not in found


def test_a_pause_stays_in_sight() -> None:
    assert "PAUSE after this trial: p cancels" in "\n".join(lines(Frame(view=view(), pausing=True)))
    paused = Frame(view=view(state="paused", plan=plan(7)[:3]), pausing=True)
    assert "PAUSED: p continues" in "\n".join(lines(paused))


@pytest.mark.parametrize(("typed", "question"), [("dr", "What is it?"), ("skin d", "")])
def test_a_line_being_typed_is_shown_with_the_keys_that_work(typed: str, question: str) -> None:
    found = "\n".join(lines(Frame(view=view(), typed=typed, question=question)))
    assert f"{question or 'Note:'} {typed}_" in found
    assert "Ctrl-E EMERGENCY STOP" in found
    assert "r repeat" not in found


@pytest.mark.parametrize(("width", "height"), SIZES[:3])
def test_help_explains_every_key(width: int, height: int) -> None:
    found = "\n".join(lines(Frame(view=view(), help=True), None, width, height))
    for words in ("pause before the next", "break the running", "note for the", "EMERGENCY STOP"):
        assert words in found


def test_what_a_terminal_would_obey_is_shown_as_escapes() -> None:
    hostile = "\x1b[2J\n\u202e[red]"
    frame = Frame(
        view=view(session=hostile, identity=hostile, beam=hostile, plan=plan(2)),
        question=hostile,
        typed=hostile,
        messages=(("14:03:21", hostile),),
    )
    found = lines(frame, None, 120, 40)
    assert [line for line in found if visible(line) != line] == []
    assert sum(line.count(r"\x1b[2J\n\u202e[red]") for line in found) == 6


def test_a_call_rings(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb", buffering=0) as terminal, os.fdopen(writing, "wb") as output:
        monkeypatch.setattr(sys, "stdout", output)
        with LiveDisplay(lambda: None) as display:
            display.show(Frame(view=view()))
            written = b""
            while b"EMERGENCY STOP" not in written:
                written += terminal.read(65536)
            assert b"\x07" not in written
            display.show(Frame(view=view(), calls=1))
            while b"PARTICIPANT CALLS" not in written:
                written += terminal.read(65536)
            assert written.count(b"\x07") == 1


@pytest.mark.parametrize(
    ("error", "raised"),
    [(OSError(5, "Input/output error"), TerminalGone), (ValueError("a gone font"), ValueError)],
)
def test_what_ends_the_drawing_ends_the_session(
    error: Exception, raised: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody must watch a screen that stands still."""
    frame = Frame(view=view())

    def broken() -> Reading:
        raise error

    def watched() -> None:
        with LiveDisplay(broken) as display:
            while True:
                display.show(frame)

    with Path(os.devnull).open("wb") as output:
        monkeypatch.setattr(sys, "stdout", output)
        with pytest.raises(raised, match="gone"):
            watched()


def test_the_participants_page_is_shown_with_the_time_on_it() -> None:
    now = moment()
    found = lines(Frame(view=view(), page="question age", page_s=now.now_s - 75), now)
    assert row(found, "participant:") == " participant: question age, for 1:15"
    assert not any("participant:" in line for line in lines(Frame(view=view()), now))


KEYS_ELSEWHERE = WindowState(has_keys=False, is_shown=True)
KEYS_IN_WINDOW = WindowState(has_keys=True, is_shown=True)


@pytest.mark.parametrize(
    ("window", "types", "last", "style"),
    [
        (None, False, STOP_KEYS, "bold red"),
        (KEYS_ELSEWHERE, False, STOP_KEYS, "bold red"),
        (KEYS_ELSEWHERE, True, TYPES, "bold red"),
        (KEYS_IN_WINDOW, False, IN_WINDOW, "bold white on red"),
        (KEYS_IN_WINDOW, True, IN_WINDOW, "bold white on red"),
    ],
)
def test_the_last_line_has_the_stop_keys_that_work(
    window: WindowState | None, types: bool, last: str, style: str
) -> None:
    frame = Frame(view=view(), window=window, types=types)
    shown = screen_lines(frame, moment(), 80, 24)[-1]
    assert (shown.plain.strip(), shown.style) == (last, style)
    noting = lines(replace(frame, typed="skin d"))
    assert ("PARTICIPANT'S WINDOW" in "".join(noting[-3:])) is (window == KEYS_IN_WINDOW)
    assert "Ctrl-E EMERGENCY STOP" in noting[-1]


def test_where_keys_go_stands_beside_the_page() -> None:
    for window, place in ((KEYS_IN_WINDOW, "the window"), (KEYS_ELSEWHERE, "elsewhere")):
        found = lines(Frame(view=view(), page="question job", window=window))
        assert row(found, "participant:").endswith(f"   keys: {place}")
    away = lines(Frame(view=view(), window=WindowState(has_keys=False, is_shown=False)))
    assert any("THE PARTICIPANT'S WINDOW IS MINIMISED" in line for line in away)
    mute = lines(Frame(view=view(), window=KEYS_ELSEWHERE, types=True))
    assert any("THE PARTICIPANT CANNOT TYPE: click the window" in line for line in mute)


def test_the_log_has_what_was_told_before_an_interruption() -> None:
    told = (("09:00:00", "noted: skin dry"), ("14:03:00", "noted: skin moist"))
    found = lines(Frame(view=view(), messages=told, recalled=1))
    assert any("09:00:00 noted: skin dry" in line for line in found)


def test_a_correction_says_what_is_typed() -> None:
    found = lines(Frame(view=view(), typed="age 31", typing="Name, answer [because reason]"))
    assert " Name, answer [because reason]: age 31_" in found
