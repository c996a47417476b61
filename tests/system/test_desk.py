"""Sessions at a real desk: where keys go, what stops a session, and what a held key does."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.runner.command_line import TOUCHBEAM
from tests.runner.window.desktop import CONSOLE, PARTICIPANT, Desk, Monitor, Terminal, desk, until
from tests.runner.window.sessions import Seat, short_study

pytestmark = pytest.mark.waits

WIDE = Monitor(width=1600, height=1100)
WITHIN_S = 0.5
JOB = """
[[question]]
name = "job"
kind = "text"
when = "before"
text = { en = "What do you do for a living?", zh = "您的职业？" }
"""
SKIPPED = """
[[question]]
name = "{0}"
kind = "number"
when = "before"
required = false
text = {{ en = "How many {0} did you drink?", zh = "您喝了几杯？" }}
"""


def one_condition(*questions: str) -> str:
    """A study of one condition, with touches that leave time to act."""
    study = short_study(conditions=["frequency"]).replace("hold_s = 0.25", "hold_s = 4")
    return "\n".join([study, *questions])


@dataclass
class Sitting:
    """A session of a person at the window and an operator in a terminal, at one desk."""

    desk: Desk
    seat: Seat
    terminal: Terminal

    def wait_for(self, page: str) -> None:
        """Wait until the participant is on this page."""
        self.terminal.watch(f"participant: {page},")

    def leave(self, page: str) -> None:
        """Press Enter in the window until the participant is on another page."""
        self.wait_for(page)
        self.desk.focus(PARTICIPANT)
        while f"participant: {page}," in self.terminal.text:
            self.desk.key("Return")
            time.sleep(0.3)

    def touch(self) -> None:
        """Go on to the first touch, until the output is on."""
        self.leave("welcome")
        until(lambda: self.of("trial-started"))
        while not self.of("touch-started"):
            self.desk.focus(PARTICIPANT)
            self.desk.key("Return")
            time.sleep(0.3)
        self.terminal.watch("OUTPUT ON")

    def of(self, tag: str) -> Sequence[dict[str, object]]:
        """Return the payloads of one kind of event."""
        return [dict(payload) for payload in self.seat.payloads(tag)]

    def off_after(self, keys: str) -> float:
        """Press keys, and return how long it took until the trial was broken off, s."""
        pressed_s = time.time()
        self.desk.key(keys)
        until(lambda: self.of("trial-aborted"))
        (aborted,) = (event for event in self.seat.events() if event.tag == "trial-aborted")
        return aborted.utc.timestamp() - pressed_s


@contextmanager
def sitting(folder: Path, study: str) -> Iterator[Sitting]:
    """Begin a session at a desk, and mount the beam."""
    with desk(WIDE) as table:
        seat = Seat(folder / "study", table.display, study=study)
        run = [TOUCHBEAM, "run", str(seat.folder), "--participant", "P01", "--rehearsal"]
        command = [*run, "--ratings", "window", "--windowed"]
        with table.terminal(command, folder / "printed", seat.environment) as terminal:
            terminal.watch("Mount the beam")
            table.move(PARTICIPANT, 760, 60)
            table.focus(CONSOLE)
            table.key("Return")
            yield Sitting(table, seat, terminal)


STOPS = [(PARTICIPANT, "ctrl+e"), (CONSOLE, "e"), (CONSOLE, "space"), (CONSOLE, "ctrl+e")]
MORE = [*STOPS[:1] * 9, *STOPS[2:], *STOPS[1:] * 2, *STOPS[1:2]]
"""With the first two of `STOPS`, ten of each window."""


@pytest.mark.parametrize(
    ("title", "keys"),
    [*STOPS[:2], *(pytest.param(*stop, marks=pytest.mark.soak) for stop in MORE)],
)
def test_a_stop_key_works_during_a_touch_wherever_keys_go(
    title: str, keys: str, tmp_path: Path
) -> None:
    with sitting(tmp_path, one_condition()) as seated:
        seated.touch()
        seated.desk.focus(title)
        took_s = seated.off_after(keys)
        print(f"{keys} in {title}: {took_s:.3f} s")
        assert took_s < WITHIN_S
        until(lambda: seated.of("device-off"))
        (off,) = seated.of("device-off")
        place = " in the participant's window" * (title == PARTICIPANT)
        assert off == {"confirmed": True, "why": f"emergency stop{place}"}


def test_what_a_participant_types_stops_nothing_wherever_it_goes(tmp_path: Path) -> None:
    with sitting(tmp_path, one_condition(JOB)) as seated:
        seated.leave("welcome")
        seated.wait_for("question job")
        for title, place in ((CONSOLE, "elsewhere"), (PARTICIPANT, "the window")):
            seated.desk.focus(title)
            seated.terminal.watch(f"keys: {place}")
            for text in ("teacher", "e e e", " ", "n c"):
                seated.desk.type(text)
        # What was typed at the console began no line, in which letters would stop nothing later.
        seated.leave("question job")
        seated.wait_for("a touch")
        assert [entry["answer"] for entry in seated.of("question-answered")] == ["teachere e e n c"]
        assert not seated.of("device-off")
        assert "Note:" not in seated.terminal.text


def test_where_keys_go_is_shown_and_kept(tmp_path: Path) -> None:
    with sitting(tmp_path, one_condition()) as seated:
        table, terminal = seated.desk, seated.terminal
        seated.wait_for("welcome")
        terminal.watch("keys: elsewhere")
        table.focus(PARTICIPANT)
        terminal.watch("EMERGENCY STOP: Ctrl-E alone; KEYS GO TO THE PARTICIPANT'S WINDOW")
        table.minimise(PARTICIPANT)
        terminal.watch("THE PARTICIPANT'S WINDOW IS MINIMISED")
        table.focus(PARTICIPANT)
        terminal.watch("keys: the window")
        table.focus(CONSOLE)
        terminal.watch("EMERGENCY STOP: e, space, Ctrl-E")
        changes = [(entry["has_keys"], entry["is_shown"]) for entry in seated.of("window-changed")]
    # A window is unmapped and its keys taken away in either order.
    seen = [change for change in changes if change not in {(False, False), (True, False)}]
    assert len(seen) < len(changes), "it was minimised"
    assert [has_keys for has_keys, _ in seen][-3:] == [True, True, False], changes


def test_enter_held_for_14_s_passes_one_page(tmp_path: Path) -> None:
    study = one_condition(SKIPPED.format("cups"), SKIPPED.format("glasses"))
    with sitting(tmp_path, study) as seated:
        seated.desk.focus(PARTICIPANT)
        seated.terminal.watch("participant: welcome, for 0:01")
        seated.desk.hold("Return", 14)
        assert "participant: question cups," in seated.terminal.text
        assert not seated.of("question-answered")
        assert not seated.of("touch-started")
        seated.desk.key("Return")
        seated.wait_for("question glasses")
