"""The session's side of the window: answers, silence, and the end of the process."""

import io
import math
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import WorkFailed
from protocol.study.languages import built_in
from protocol.study.participant_texts import study_wording
from protocol.study_file.loading import parsed_study, template
from runner.screens import Instruction, Notice, Response, WindowState, ask_change
from runner.signals import errors_are_last, signals_raise
from runner.window.client import (
    SILENT_S,
    WindowGone,
    WindowParticipant,
    WindowProcess,
    participant_window,
)
from runner.window.elements import Input, Key, Pressed, Released, Typed, first_font, missing_font
from runner.window.messages import (
    Settings,
    inputs_of,
    line_of,
    message_of,
    press_message,
    screen_of,
    settings_message,
    settings_of,
    show_message,
)
from runner.window.preflight import foreseen
from runner.window.server import mailbox_of
from tests.protocol.studies import TRACKS

pytestmark = pytest.mark.waits

PAPER = parsed_study(template("paper"))
ALIVE = {"alive": 1.0}


@dataclass
class FakePeer:
    """Says `said`, once."""

    said: list[Mapping[str, Any]] = field(default_factory=list)
    heard: list[Mapping[str, Any]] = field(default_factory=list)

    def send(self, message: Mapping[str, Any]) -> None:
        self.heard.append(message)

    def received(self) -> list[Mapping[str, Any]]:
        said, self.said = self.said, []
        return said


@dataclass
class At:
    """A participant, its peer, and the time."""

    peer: FakePeer = field(default_factory=FakePeer)
    t_s: float = 0.0

    def __post_init__(self) -> None:
        self.participant = WindowParticipant(self.peer, lambda: self.t_s)

    def poll(self, *said: Mapping[str, Any], after_s: float = 0.05) -> Response | None:
        self.t_s += after_s
        self.peer.said += said
        return self.participant.poll()


def answer(number: int, text: str) -> dict[str, Any]:
    return {"answer": text, "of": number, "reaction_time_s": 0.7, "trace": {"path": []}}


def test_an_answer_is_returned_once() -> None:
    at = At()
    at.participant.show(ask_change("places"))
    assert at.poll(ALIVE) is None
    given = at.poll({"shown": 1, "at_s": 5.0}, answer(1, "swapped"))
    assert given == Response(answer="swapped", reaction_time_s=0.7, trace={"path": []})
    assert at.poll(ALIVE) is None


def test_an_answer_to_the_previous_screen_is_ignored() -> None:
    at = At()
    at.participant.show(Instruction(text="remember"))
    at.participant.show(ask_change("places"))
    assert at.poll(answer(1, "ready")) is None


def test_the_window_hears_that_the_answer_is_saved() -> None:
    at = At()
    at.participant.show(Instruction(text="remember"))
    at.participant.saved()
    assert at.peer.heard[-1] == {"saved": 1}


def test_the_window_hears_which_trial_comes() -> None:
    at = At()
    at.participant.progress(3, 12)
    assert at.peer.heard == [{"progress": [3, 12]}]


def presses(at: At) -> list[Any]:
    return [message["press"] for message in at.peer.heard if "press" in message]


def test_keys_are_pressed_when_the_page_can_take_them() -> None:
    at = At()
    at.participant.readable_s = 1.0
    at.participant.show(ask_change("places"))
    at.participant.press("not swapped", 0.5)
    at.poll(ALIVE, after_s=5.0)
    assert presses(at) == []  # the page is not seen yet
    at.poll({"shown": 1, "at_s": 5.0})
    at.poll(ALIVE, after_s=0.45)
    assert presses(at) == []
    at.poll(ALIVE, after_s=0.1)
    assert presses(at) == [[{"input": "Key", "name": "2", "repeated": False}]]
    at.poll(ALIVE, after_s=0.4)
    assert len(presses(at)) == 1
    at.poll(ALIVE, after_s=0.1)
    assert presses(at)[1:] == [[{"input": "Key", "name": "enter", "repeated": False}]]
    at.poll(ALIVE)
    assert len(presses(at)) == 2


def test_keys_that_were_due_on_a_page_are_not_pressed_on_the_next() -> None:
    at = At()
    at.participant.show(Instruction(text="remember"))
    at.participant.press("ready", 0.5)
    at.participant.show(ask_change("places"))
    at.poll({"shown": 1, "at_s": 5.0}, {"shown": 2, "at_s": 5.0})
    at.poll(ALIVE, after_s=2.0)
    assert presses(at) == []


def test_inputs_arrive_as_they_were_sent() -> None:
    inputs: list[Input] = [Key(name="3"), Typed(text="é"), Pressed(x=1.5, y=-2.0), Released()]
    assert inputs_of(message_of(line_of(press_message(inputs)))) == inputs


@pytest.mark.parametrize(
    ("text", "lingers"), [("thanks", True), ("stopped", True), ("pause", False)]
)
def test_only_the_last_page_lingers_until_it_is_closed(text: str, lingers: bool) -> None:
    at = At()
    at.participant.show(Notice(text=text))
    at.peer.said.append(answer(1, "ready"))
    at.participant.linger(longest_s=60.0)
    assert (at.peer.said == []) is lingers


def test_a_signal_takes_the_last_page_away_though_an_error_defers_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    at = At()
    at.participant.show(Notice(text="stopped"))
    monkeypatch.setattr(time, "sleep", lambda _: signal.raise_signal(signal.SIGINT))
    last_page = ExitStack()
    last_page.callback(at.participant.linger, longest_s=float("inf"))
    with pytest.raises(OSError, match="UNKNOWN"), signals_raise(), last_page, errors_are_last():
        raise OSError("output state UNKNOWN")


def test_a_silent_window_ends_the_session_within_bounded_time() -> None:
    at = At()
    at.participant.show(Notice(text="pause"))
    at.poll(ALIVE)
    while at.t_s < SILENT_S:
        assert at.poll() is None
    with pytest.raises(WindowGone, match=r"does not respond \(silent for 2 s\).*--ratings console"):
        at.poll(after_s=0.2)


def test_a_slow_session_does_not_blame_the_window() -> None:
    at = At()
    at.participant.show(Notice(text="pause"))
    at.poll(ALIVE)
    assert at.poll(after_s=600.0) is None
    assert at.poll(ALIVE) is None


def test_a_closed_window_ends_the_session() -> None:
    at = At()
    with pytest.raises(WindowGone, match=r"window was closed; .*--ratings console"):
        at.poll({"closed": True})


def test_a_window_that_cannot_draw_ends_the_session() -> None:
    at = At()
    with pytest.raises(WindowGone, match=r"cannot draw \(out of memory\); .*--ratings console"):
        at.poll({"broken": "out of memory"})


def test_the_emergency_stop_of_the_window_stays_and_is_no_answer() -> None:
    at = At()
    at.participant.show(Notice(text="pause"))
    assert not at.participant.stops()
    at.peer.said.append({"stop": True})
    assert at.participant.stops()
    assert at.poll(ALIVE) is None
    assert at.participant.stops()


def test_the_state_of_the_window_is_the_last_one() -> None:
    at = At()
    assert at.participant.window_state() is None
    for state in ({"has_keys": True, "is_shown": True}, {"has_keys": False, "is_shown": False}):
        at.poll({"alive": 1.0, "state": state})
        assert at.participant.window_state() == WindowState(**state)


def test_an_answer_counts_though_the_window_ended_after_it_and_somebody_asked_for_a_stop() -> None:
    at = At()
    at.participant.show(Instruction(text="remember"))
    at.peer.said.append(answer(1, "ready"))
    assert not at.participant.stops()
    at.peer.said.append({"closed": True})
    assert at.participant.poll() is not None
    with pytest.raises(WindowGone, match="closed"):
        at.participant.poll()


def test_escape_calls_the_operator_only() -> None:
    at = At()
    calls: list[str] = []
    at.participant.call_operator = lambda: calls.append("called")
    assert at.poll({"operator": True}) is None
    assert calls == ["called"]


def test_a_missing_display_gives_one_line_that_names_the_console(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    expected = r"needs a display \(DISPLAY is not set\); use --ratings console"
    with (
        pytest.raises(WorkFailed, match=expected),
        participant_window(["false"], Settings(wording=study_wording(PAPER, "en"))),
    ):
        raise AssertionError("a window was opened without a display")


@pytest.mark.parametrize(
    ("said", "how"),
    [
        ({"closed": True}, "was closed"),
        ({"unseen": "lost screen 1 (1024x768 at 1280,0)"}, "lost screen 1 (1024x768 at 1280,0)"),
        ({"broken": "no memory"}, "cannot draw (no memory)"),
    ],
)
def test_a_message_that_the_window_no_longer_takes_fails_for_the_reason_that_it_gave(
    said: Mapping[str, Any], how: str
) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", f"print({line_of(said)!r}, end='')"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )
    peer = WindowProcess(process, io.BytesIO())
    process.wait()
    try:
        for _ in range(2):
            with pytest.raises(WindowGone, match=re.escape(f"the participant's window {how}; ")):
                peer.send({"saved": 1})
        with pytest.raises(WindowGone, match=re.escape(how)):
            peer.received()
    finally:
        peer.end()


def last_words(program: str) -> str:
    """Return what ends a session whose window is this program, within bounded time."""
    with tempfile.TemporaryFile() as complaints:
        command = [sys.executable, "-c", f"import os, sys; {program}"]
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
            encoding="utf-8",
        )
        peer = WindowProcess(process, complaints)
        participant = WindowParticipant(peer, time.monotonic)
        begun_s = time.monotonic()
        try:
            participant.show(Notice(text="pause"))
            while time.monotonic() < begun_s + 10:
                participant.poll()
                time.sleep(0.01)
        except WindowGone as error:
            for _ in range(5):  # on its way out a session shows and asks more
                participant.is_there()
            return str(error)
        finally:
            peer.end()
    raise AssertionError("the session goes on")


@pytest.mark.parametrize(
    "garbage", [b"rubbish\n", b"\xff\xfe\n", b"[1]\n", b'{"answer": 1}{\n', b"\0" * 9 + b"\n"]
)
def test_a_window_that_sends_garbage_ends_the_session_in_one_line(garbage: bytes) -> None:
    said = last_words(f"os.write(1, {garbage!r}); sys.stdin.read()")
    assert said.startswith("the participant's window sent an invalid message (")
    assert "\n" not in said
    assert said.endswith("--ratings console works without it")


def test_an_incomplete_answer_ends_the_session_in_one_line() -> None:
    line = line_of({"answer": "ready", "of": 1, "trace": None})
    said = last_words(f"os.write(1, {line.encode()!r}); sys.stdin.read()")
    assert said.startswith(
        "the participant's window sent an answer without 'reaction_time_s'; --ratings"
    )


@pytest.mark.parametrize(
    ("end", "told"),
    [
        ("os.kill(os.getpid(), 9)", " (signal SIGKILL); --ratings"),
        ("os.abort()", " (signal SIGABRT); --ratings"),
        ("os._exit(3)", ": Xlib: extension missing; --ratings"),
        (
            "os.write(2, b'X connection to :7 broken\\n'); os._exit(1)",
            " (its display was lost); --ratings",
        ),
    ],
)
def test_the_end_of_a_window_is_told_with_its_cause(end: str, told: str) -> None:
    said = last_words(f"print('Xlib: extension missing', file=sys.stderr, flush=True); {end}")
    assert said.startswith(f"the participant's window ended unexpectedly{told}")


def test_a_window_that_hangs_once_its_pipe_is_closed_is_waited_for_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So does one whose display was lost; the output may be on meanwhile."""
    waited: list[float] = []
    wait = subprocess.Popen.wait

    def counted(process: "subprocess.Popen[str]", timeout: float | None = None) -> int:
        if process.poll() is None:
            waited.append(timeout or math.inf)
        return wait(process, timeout)

    monkeypatch.setattr(subprocess.Popen, "wait", counted)
    said = last_words("os.write(2, b'lost'); os.close(1); import time; time.sleep(99)")
    assert said.startswith("the participant's window ended unexpectedly: lost; --ratings")
    assert sum(waited) < 3.5


def test_a_window_that_hears_garbage_says_so_and_ends(capsys: pytest.CaptureFixture[str]) -> None:
    mailbox = mailbox_of(io.StringIO("rubbish\n"))
    assert mailbox.get(timeout=2) == {"lost": True}
    assert capsys.readouterr().err == "a message must be one JSON object, got 'rubbish\\n'\n"


@pytest.mark.parametrize(
    "screen",
    [*foreseen(PAPER, consent="C-7"), *foreseen(parsed_study(TRACKS), consent=None)[-20:]],
    ids=str,
)
def test_every_screen_survives_the_messages_unchanged(screen: Any) -> None:
    assert screen_of(message_of(line_of(show_message(3, screen)))) == screen


@pytest.mark.parametrize("language", ["en", "zh"])
def test_the_settings_survive_the_messages_unchanged(language: Any) -> None:
    settings = Settings(
        wording=study_wording(PAPER, language),
        screen=1,
        windowed=True,
        foreseen=foreseen(PAPER, consent=None),
    )
    assert settings_of(message_of(line_of(settings_message(settings)))) == settings


@given(line=st.sampled_from(["", "{", "7", "null", '"text"', "[1, 2]", "\x00"]))
def test_a_line_that_is_not_a_message_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match="must be one JSON object, got ") as refused:
        message_of(line)
    assert repr(line) in str(refused.value)


def test_an_unknown_screen_is_refused() -> None:
    with pytest.raises(ValueError, match=r"must be one of Notice, .*, got Film"):
        screen_of({"show": 1, "screen": "Film"})


def test_the_first_available_font_is_used() -> None:
    fonts = built_in("zh").fonts
    assert first_font(fonts, {"Noto Sans CJK JP", "PingFang SC"}.__contains__) == "Noto Sans CJK JP"
    assert first_font(fonts, {"DejaVu Sans"}.__contains__) is None
    assert f"{fonts[0]}, " in missing_font("zh", fonts, "fonts-wqy-microhei")
    assert "install one of them, or use" in missing_font("xx", ("Nice Sans",), None)
