"""The window's process without a window: a recording canvas and a manual clock."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import pytest

from protocol.study.participant_texts import study_wording
from protocol.study.rules import Rating
from protocol.study_file.loading import parsed_study, template
from runner.screens import Instruction, Notice, Pacing, ask_score
from runner.window.elements import STOP, Dot, Element, Input, Key, Page, Pressed
from runner.window.messages import Settings, press_message, show_message
from runner.window.pages import page, targets
from runner.window.question_pages import Button, PageState
from runner.window.server import ALIVE_EVERY_S, ORPHANED_S, Mailbox, WindowServer, frame_record

INTERVAL_S = 1 / 60
SETTINGS = Settings(
    wording=study_wording(parsed_study(template("paper")), "en"),
    foreseen=(ask_score(Rating()),),
)
PACING = Pacing(start_m=0.0, end_m=0.1, duration_s=1.0, force_n=0.5, direction="right")


class NeverWaits(Mailbox):
    """A mailbox that waits on the test's clock, not in real time."""

    def get(self, block: bool = True, timeout: float | None = None) -> Mapping[str, Any]:
        return self.get_nowait()


@dataclass
class FakeCanvas:
    """A 60 Hz screen whose flips can wait for its refresh; `script` acts at frames."""

    script: dict[int, Any]
    holds_back: bool = False
    closed: bool = False
    state: dict[str, bool] = field(default_factory=lambda: {"has_keys": True, "is_shown": True})
    lost: str = ""
    t_s: float = 0.0
    flips: int = 0
    drawn: list[Page] = field(default_factory=list)
    prepared: list[Element] = field(default_factory=list)
    waiting: list[tuple[float, Input]] = field(default_factory=list)

    def look(self) -> dict[str, Any]:
        return {"refresh_hz": None, "px_per_unit": 1.0, "mm_per_px": 0.25, "screen": 0}

    def draw(self, page: Page) -> None:
        self.drawn.append(page)
        self.t_s += 0.003

    def prepare(self, element: Element) -> None:
        self.prepared.append(element)

    def flip(self) -> float:
        self.flips += 1
        if self.holds_back:
            self.t_s = (self.t_s // INTERVAL_S + 1) * INTERVAL_S
        if self.flips in self.script:
            self.script[self.flips](self)
        return self.t_s

    def inputs(self) -> list[tuple[float, Input]]:
        self.t_s += 0.001
        taken, self.waiting = self.waiting, []
        return taken

    def press(self, given: Input | str) -> None:
        given = Key(name=given) if isinstance(given, str) else given
        self.waiting.append((self.t_s, given))

    def close_window(self) -> None:
        self.closed = True


def served(
    script: dict[int, Any], *, holds_back: bool = True, readable_s: float = 0.0
) -> tuple[FakeCanvas, list[Any]]:
    """Serve until the script ends it; the flips before the first screen are the first seven."""
    mailbox = NeverWaits()
    sent: list[Mapping[str, Any]] = []
    canvas = FakeCanvas({}, holds_back=holds_back)
    canvas.script = {
        at: (lambda _, act=act: act(canvas) if callable(act) else mailbox.put(act))
        for at, act in script.items()
    }
    settings = replace(SETTINGS, readable_s=readable_s)
    WindowServer(canvas, settings, mailbox, sent.append, lambda: canvas.t_s).run()
    return canvas, sent


def answers(sent: list[Any]) -> list[Any]:
    return [message for message in sent if "answer" in message]


def test_keys_from_the_session_are_taken_as_those_of_a_person() -> None:
    _, sent = served(
        {
            8: show_message(1, ask_score(Rating())),
            30: press_message([Key(name="4"), Key(name="enter")]),
            70: {"end": True},
        }
    )
    (given,) = answers(sent)
    assert given["answer"] == "4"
    assert [change["by"] for change in given["trace"]["changes"]] == ["key"]


def test_a_score_is_sent_with_its_trace_and_the_previous_screens() -> None:
    canvas, sent = served(
        {
            8: show_message(1, PACING),
            30: show_message(2, ask_score(Rating())),
            50: lambda canvas: canvas.press("7"),
            60: lambda canvas: canvas.press("enter"),
            70: {"end": True},
        }
    )
    assert "opened" in sent[0]
    assert [message["shown"] for message in sent if "shown" in message] == [1, 2]
    (answer,) = answers(sent)
    assert (answer["answer"], answer["of"]) == ("7", 2)
    trace = answer["trace"]
    assert [screen["screen"] for screen in trace["screens"]] == ["wait", "pacing", "score"]
    assert trace["start"]["t_s"] == answer["reaction_time_s"] < trace["confirmed_s"]
    assert trace["scale"]["length_mm"] == 660 * 0.25
    assert trace["scale"]["ticks"] == list(range(11))
    assert canvas.prepared, "foreseen pages are built before they are needed"
    assert len(canvas.prepared) == len(set(canvas.prepared)), "each element once"


LOST = {"lost": True}


def last_pages(canvas: FakeCanvas) -> list[Page]:
    stopped = page(Notice(text="stopped"), PageState(), SETTINGS.wording)
    return [drawn for drawn in canvas.drawn if set(stopped) <= set(drawn)]


def test_a_window_whose_session_is_gone_asks_to_lift_the_finger_for_a_while() -> None:
    canvas, _ = served({8: show_message(1, PACING), 30: LOST})
    assert canvas.flips / 60 == pytest.approx(ORPHANED_S, abs=2)
    assert len(last_pages(canvas)) > canvas.flips - 40


@pytest.mark.parametrize("ends", [lambda canvas: canvas.press("enter"), FakeCanvas.close_window])
def test_the_last_page_of_a_window_whose_session_is_gone_can_be_closed(ends: Any) -> None:
    canvas, _ = served({8: show_message(1, PACING), 30: LOST, 60: ends})
    assert 50 < canvas.flips < 70


def test_a_window_that_shows_its_last_page_already_ends_with_its_session() -> None:
    canvas, _ = served({8: show_message(1, Notice(text="thanks")), 30: LOST})
    assert canvas.flips < 40


@pytest.mark.parametrize("holds_back", [True, False])
def test_frames_follow_the_refresh_rate_paced_by_screen_or_clock(holds_back: bool) -> None:
    canvas, sent = served(
        {
            8: show_message(1, Instruction(text="remember")),
            200: lambda canvas: canvas.press("enter"),
            210: {"end": True},
        },
        holds_back=holds_back,
    )
    (answer,) = answers(sent)
    frames = answer["trace"]["screens"][-1]
    assert frames["median_ms"] == pytest.approx(1000 * INTERVAL_S, abs=1.1)
    assert frames["dropped"] == []
    assert answer["trace"]["display"]["paced_by"] == ("screen" if holds_back else "clock")
    # Where a clock paces them, a page that stays is drawn when the next `alive` is due.
    assert canvas.t_s == pytest.approx(210 / 60 if holds_back else 202 * ALIVE_EVERY_S, rel=0.1)


@pytest.mark.parametrize("holds_back", [True, False])
def test_a_page_that_moves_is_drawn_at_each_refresh(holds_back: bool) -> None:
    canvas, _ = served({8: show_message(1, PACING), 68: {"end": True}}, holds_back=holds_back)
    assert canvas.t_s == pytest.approx(68 * INTERVAL_S, abs=0.1)


def test_a_new_screen_is_drawn_at_once() -> None:
    canvas, _ = served({8: show_message(1, PACING), 9: {"end": True}})
    before = [page for page in canvas.drawn if not any(isinstance(e, Dot) for e in page)]
    assert len(canvas.drawn) - len(before) >= 1
    assert canvas.drawn[8] != canvas.drawn[7]


def test_escape_calls_the_operator_and_does_not_end_the_session() -> None:
    _, sent = served(
        {
            8: show_message(1, Instruction(text="remember")),
            30: lambda canvas: canvas.press("escape"),
            60: lambda canvas: canvas.press("enter"),
            70: {"end": True},
        }
    )
    assert [message for message in sent if "operator" in message] == [{"operator": True}]
    (answer,) = answers(sent)
    assert len(answer["trace"]["screens"][-1]["operator_called_s"]) == 1


@pytest.mark.parametrize(
    ("frame", "button"), [(20, "early"), (50, "live"), (70, "pressed"), (90, "saved")]
)
def test_the_button_works_once_its_page_can_be_read_and_never_after_the_answer(
    frame: int, button: Button
) -> None:
    screen = Instruction(text="remember")
    canvas, sent = served(
        {
            8: show_message(1, screen),
            20: lambda canvas: canvas.press("enter"),
            60: lambda canvas: canvas.press("enter"),
            75: lambda canvas: canvas.press("enter"),
            80: {"saved": 1},
            85: {"saved": 2},
            100: {"end": True},
        },
        readable_s=0.5,
    )
    assert canvas.drawn[frame] == page(screen, PageState(button=button), SETTINGS.wording)
    (answer,) = answers(sent)
    assert answer["reaction_time_s"] > 0.5
    assert answer["trace"]["early_presses"] == 1


def test_the_button_beside_escape_calls_the_operator() -> None:
    screen = Notice(text="wait.beam")
    (call,) = [target.box for target in targets(screen) if target.name == "call"]
    canvas, sent = served(
        {
            8: {"progress": [3, 12]},
            10: show_message(1, screen),
            30: lambda canvas: canvas.waiting.append((canvas.t_s, Pressed(x=call.x, y=call.y))),
            50: {"end": True},
        }
    )
    assert [message for message in sent if "operator" in message] == [{"operator": True}]
    called = PageState(operator_called=True, progress=(3, 12))
    assert canvas.drawn[-1] == page(screen, called, SETTINGS.wording)


def test_a_break_ends_when_its_time_is_over_and_the_participant_wants_to() -> None:
    _, sent = served(
        {
            8: show_message(1, Instruction(text="break", after_s=2.0)),
            **{frame: lambda canvas: canvas.press("enter") for frame in range(30, 170, 10)},
            180: {"end": True},
        }
    )
    (answer,) = answers(sent)
    assert 2.0 <= answer["reaction_time_s"] < 2.3


def test_a_closed_window_sends_closed() -> None:
    _, sent = served({20: FakeCanvas.close_window})
    assert sent[-1] == {"closed": True}


def test_the_emergency_stop_goes_to_the_session_from_every_page() -> None:
    def stop(canvas: FakeCanvas) -> None:
        canvas.waiting += [(canvas.t_s, STOP), (canvas.t_s, replace(STOP, repeated=True))]

    _, sent = served({3: stop, 8: show_message(1, PACING), 9: stop, 20: stop, 70: {"end": True}})
    assert [message for message in sent if "stop" in message] == [{"stop": True}] * 6


def test_where_keys_go_is_sent_when_it_changes_and_with_each_alive() -> None:
    changes = [{"has_keys": False}, {"is_shown": False}, {"has_keys": True, "is_shown": True}]
    script = {
        20 + at: lambda canvas, it=it: canvas.state.update(it) for at, it in enumerate(changes)
    }
    canvas, sent = served({8: show_message(1, PACING), **script, 100: {"end": True}})
    states = [message["state"] for message in sent if "alive" in message]
    seen = [state for at, state in enumerate(states) if at == 0 or state != states[at - 1]]
    assert [(state["has_keys"], state["is_shown"]) for state in seen] == [
        (True, True),
        (False, True),
        (False, False),
        (True, True),
    ]
    assert len(states) > len(seen)
    assert states[-1] == canvas.state


def test_a_drawing_window_sends_alive_five_times_a_second() -> None:
    canvas, sent = served({8: show_message(1, Notice(text="pause")), 308: {"end": True}})
    alive = [message["alive"] for message in sent if "alive" in message]
    gaps = [later - earlier for earlier, later in pairwise(alive)]
    assert max(gaps) < 0.25
    assert alive[-1] > canvas.t_s - 0.25


def test_dropped_frames_are_distinguished_from_late_ones() -> None:
    assert frame_record((1.0, 1.016, 1.032, 1.055, 1.087, 1.103), 0.016) == {
        "frames": 6,
        "dropped": [[0.087, 32.0]],
        "median_ms": 16.0,
        "p99_ms": 32.0,
        "max_ms": 32.0,
    }
