"""The live plot of a sliding experiment, on terminals of several sizes."""

import math

import pytest

from device.force_channel.recording import Forces
from runner.people.operator_console import Frame
from runner.people.operator_screen import screen_lines
from runner.people.sliding_block import Drawing, SlidePlot
from runner.screens import PlanLine
from tests.runner.people.test_operator_screen import SIZES, moment
from tests.runner.views import view

TO_THE_RIGHT = Drawing(
    label="pass 2, 1.005 x resonance", start_m=0.010, end_m=0.081, moves_s=100.0, duration_s=14.2
)
REFERENCE = Drawing(
    label="pass 1, reference, 0 V", start_m=0.010, end_m=0.081, moves_s=50.0, duration_s=14.2
)
SAMPLES = 284


def drawn(plot: SlidePlot, drawing: Drawing, depth: float, share: float = 1.0) -> SlidePlot:
    """Draw a pass up to a share of its way, with waves of friction of this depth about 0.4."""
    plot.begin(drawing)
    for number in range(round(share * SAMPLES)):
        at = number / SAMPLES
        place_m = drawing.start_m + at * (drawing.end_m - drawing.start_m)
        friction = 0.4 + depth * math.sin(2 * math.pi * place_m / 0.014)
        plot.take(
            Forces(
                at_s=drawing.moves_s + at * drawing.duration_s,
                tangential_n=0.56 * friction,
                normal_n=0.56,
                position_m=place_m,
            )
        )
    return plot


@pytest.fixture
def plot() -> SlidePlot:
    """A second pass at 70% of its way, after a reference."""
    made = SlidePlot()
    drawn(made, REFERENCE, 0.0).end(driven=False)
    return drawn(made, TO_THE_RIGHT, 0.08, 0.7)


AT_80_BY_24 = """\
 slide/1                                                               14:03:22
 OUTPUT ON  touching: 1.005 x resonance                          read 0.1 s ago
 mu against place  pass 2, 1.005 x resonance
   0.50 │
        │      ●●●           ●●            ●●            ●
        │     ●   ●         ●  ●          ●  ●          ●
        │                  ●    ●        ●    ●        ●
  0.400 │····●·····●·············●····················●························
        │   ●       ●     ●             ●      ●
        │                         ●    ●        ●    ●
        │  ●         ●   ●         ●  ●          ●  ●
        │●●           ●●●           ●●            ●●
   0.30 │
        └──────────────────────────────────────────────────────────────────────
         10 mm                                                            81 mm
   pace  ────────────────────────────────────────────────◆─┃───────────────────
         draw: 4 s left, the block is 2 mm behind the mark
 0 of 1 trials, about 2 min left   until 14:05   4:10 so far   beam '1 mm'
 touchbeam,BOARD,SIM,1.1   resonance 24068 Hz   watchdog 0.5 s



 p pause   r repeat trial   n note   c correct   s stop   a answer call   ? help
 EMERGENCY STOP: e, space, Ctrl-E
"""


def screen(plot: SlidePlot, width: int, height: int, now_s: float = 110.2) -> list[str]:
    plan = (PlanLine(label="1.005 x resonance", running=True),)
    frame = Frame(view=view(session="slide/1", plan=plan, kind="slide"))

    def picture(columns: int, rows: int) -> list[str]:
        return plot.lines(columns, rows, now_s)

    return [line.plain.rstrip() for line in screen_lines(frame, moment(), width, height, picture)]


def test_the_screen_at_80_by_24(plot: SlidePlot) -> None:
    assert screen(plot, 80, 24) == AT_80_BY_24.splitlines()


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_screen_fits_every_terminal(plot: SlidePlot, width: int, height: int) -> None:
    found = screen(plot, width, height)
    assert len(found) == height
    assert max(map(len, found)) <= width
    if height >= 3 and width >= 30:
        assert "EMERGENCY STOP" in found[-1]


@pytest.mark.parametrize("rows", range(20))
def test_a_plot_has_as_many_lines_as_there_is_room_for(plot: SlidePlot, rows: int) -> None:
    found = plot.lines(60, rows, 110.2)
    assert len(found) == rows
    assert ("●" in "".join(found)) == (rows >= 8), "a few lines hold the pace alone"
    assert "draw" in "".join(found) or rows < 2


@pytest.mark.parametrize(
    ("now_s", "said"),
    [
        (97.5, "the mark moves in 3"),
        (99.9, "the mark moves in 1"),
        (107.0, "draw: 7 s left, the block is 14 mm ahead of the mark"),
        (114.3, "end of the pass: output off, lift the block"),
    ],
)
def test_the_pace_says_what_to_do(plot: SlidePlot, now_s: float, said: str) -> None:
    assert plot.lines(80, 10, now_s)[-1].strip() == said


def test_a_block_drawn_to_the_left_follows_the_mark_to_the_left() -> None:
    drawing = Drawing(label="pass 1", start_m=0.081, end_m=0.010, moves_s=100.0, duration_s=14.2)
    plot = drawn(SlidePlot(), drawing, 0.08, 0.5)
    found = plot.lines(80, 12, 107.6)
    assert found[-3].split() == ["10", "mm", "81", "mm"], "the clamp stays on the left"
    assert "the block is 3 mm behind the mark" in found[-1]
    assert found[-2].index("┃") < found[-2].index("◆")


def test_a_pass_is_told_in_words(plot: SlidePlot) -> None:
    assert plot.end(driven=True) == ("pass 2, 1.005 x resonance: mu 0.399, from 0.320 to 0.480")
    assert plot.resting == pytest.approx(0.4), "that of the reference"
    plot.begin(REFERENCE)
    assert plot.end(driven=False) == "no forces were measured: was the block on the beam?"
    assert plot.resting == pytest.approx(0.4)


def test_what_is_not_a_new_measurement_of_the_block_is_left_out() -> None:
    plot = drawn(SlidePlot(), REFERENCE, 0.0, 0.1)
    before = plot.lines(80, 12, 60.0)
    known = Forces(at_s=51.3, tangential_n=0.3, normal_n=0.56, position_m=0.02)
    lifted = Forces(at_s=99.0, tangential_n=0.01, normal_n=0.002, position_m=0.05)
    plot.take(None)
    plot.take(lifted)
    assert plot.lines(80, 12, 60.0) == before
    plot.take(known)
    after = plot.lines(80, 12, 60.0)
    plot.take(known)
    assert plot.lines(80, 12, 60.0) == after != before


def test_before_the_first_pass_there_is_nothing_to_plot() -> None:
    assert SlidePlot().lines(80, 3, 0.0) == ["the plot begins with the first pass", "", ""]
