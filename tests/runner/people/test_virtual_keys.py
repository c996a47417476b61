"""A virtual participant at the window: what it presses, and what the window says was answered."""

from dataclasses import dataclass, field

import pytest

from protocol.errors import WorkFailed
from runner.people.virtual_participant import CLOSES_AFTER_S, VirtualAtWindow
from runner.screens import Notice, Response, ask_change
from tests.runner.fakes import FakeParticipant


@dataclass
class FakeWindow(FakeParticipant):
    """Takes what is pressed, or what `somebody` else presses first."""

    somebody: str | None = None
    pressed: list[tuple[str, float]] = field(default_factory=list)

    def press(self, answer: str, reaction_time_s: float) -> None:
        self.pressed.append((answer, reaction_time_s))

    def poll(self) -> Response | None:
        if not self.pressed:
            return None
        return Response(answer=self.somebody or self.pressed[-1][0], reaction_time_s=1.5)


@dataclass
class Decided(FakeParticipant):
    """Answers everything alike, once."""

    answer: Response | None = None

    def poll(self) -> Response | None:
        answer, self.answer = self.answer, None
        return answer


SWAPPED = Response(answer="swapped", reaction_time_s=0.7)


def test_the_answer_is_pressed_and_returned_as_the_window_took_it() -> None:
    window = FakeWindow()
    participant = VirtualAtWindow(Decided(answer=SWAPPED), window)
    participant.show(ask_change("places"))
    assert participant.poll() == Response(answer="swapped", reaction_time_s=1.5)
    assert window.pressed == [("swapped", 0.7)]


def test_an_answer_that_somebody_else_pressed_is_refused() -> None:
    participant = VirtualAtWindow(Decided(answer=SWAPPED), FakeWindow(somebody="not swapped"))
    participant.show(ask_change("places"))
    with pytest.raises(WorkFailed, match="took 'not swapped', which the virtual participant did"):
        participant.poll()


@pytest.mark.parametrize(("text", "closed"), [("thanks", True), ("stopped", True), ("wait", False)])
def test_the_last_page_is_closed_after_reading(text: str, closed: bool) -> None:
    window = FakeWindow()
    VirtualAtWindow(Decided(), window).show(Notice(text=text))
    assert window.pressed == [("ready", CLOSES_AFTER_S)] * closed
