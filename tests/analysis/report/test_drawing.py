"""Figures of the report: names that the font can draw, and the scale of the scores."""

import re
from functools import partial
from itertools import count

import numpy as np
import pytest

from analysis.report.drawing import (
    FORMATS,
    Panel,
    Series,
    Words,
    drawing,
    marked,
    panels_files,
)
from analysis.report.figure_data import (
    factor_figure,
    noticed_figure,
    people_figure,
    raincloud_figure,
    scatter_figure,
)
from analysis.report.findings import Scale
from analysis.sensitivity.lines import Ratings
from tests.analysis.reports import SCORES, imported, made


def test_names_missing_from_the_font_are_numbered_and_dollars_do_not_start_formulas() -> None:
    found = made(SCORES[:1], names=("电压", "$a^$", "pressure")).figures[0].drawing
    assert found is not None
    assert ">condition 1</text>" in found.svg
    assert ">$a^$</text>" in found.svg


def cloud(highest: float) -> list[float]:
    """Return the first cloud's outline for scores on a scale from 0 to `highest`."""
    table = imported(np.tile(SCORES, (2, 1)) * highest / 10).table
    scale = Scale(0, highest)
    words, scores = Words(name="scores", title="", description=""), table.scores
    draw = partial(raincloud_figure, table, scores, scores.mean(axis=0), "score", scale)
    svg = drawing(draw, words).svg
    _, _, rest = svg.partition('id="scores-FillBetweenPolyCollection_1"')
    outline = re.search(r' d="([^"]*)"', rest)
    assert outline is not None
    return [float(y) for y in re.findall(r"-?[\d.]+ (-?[\d.]+)", outline[1])]


def test_clouds_have_the_same_shape_on_every_scale() -> None:
    assert len(cloud(10)) > 400
    assert cloud(100) == pytest.approx(cloud(10), abs=0.01)


@pytest.mark.parametrize("count", [23, 100])
def test_many_conditions_have_room(count: int) -> None:
    """Matplotlib would warn, and a warning is an error here."""
    names = tuple(f"condition {number}" for number in range(count))
    scores = np.arange(4 * count).reshape(4, count) % 11
    table, scale = imported(scores, names=names).table, Scale(0, 10)
    words = Words(name="scores", title="", description="")
    means = table.scores.mean(axis=0)
    drawing(partial(raincloud_figure, table, table.scores, means, "response", scale), words)
    ratings = Ratings(
        subjects=table.subjects,
        conditions=names,
        subject=np.repeat(np.arange(4), count),
        condition=np.tile(np.arange(count), 4),
        contrast=np.linspace(0, 1, 4 * count),
        rating=table.scores.ravel(),
    )
    at = np.array([0.0, 1.0])
    draw = partial(scatter_figure, ratings, scale, (at, at), {})
    svg = drawing(draw, words).svg
    assert len(set(re.findall(">condition [0-9]+</text>", svg))) == count


def test_no_two_conditions_have_the_same_marker() -> None:
    made = [marked(number) for number in range(100)]
    assert len({(each["marker"], each["fillstyle"]) for each in made[:42]}) == 42
    looks = {(each["marker"], each["fillstyle"], each["color"]) for each in made}
    assert len(looks) == 100
    assert [each["fillstyle"] for each in made[:7]] == ["full"] * 7


@pytest.mark.parametrize("count", [5, 12, 30])
def test_the_names_of_many_conditions_have_room_below_each_subject(count: int) -> None:
    names = tuple(f"condition {number}" for number in range(count))
    means = np.full(count, 5.0)
    scores = {f"P{who}": tuple(np.array([5.0]) for _ in names) for who in range(12)}
    words = Words(name="people", title="", description="")
    svg = drawing(partial(people_figure, names, scores, means, Scale(0, 10)), words).svg
    names_at = re.findall(r"translate\(([\d.]+) [\d.]+\) rotate\(-90\)", svg)
    places = sorted({float(x) for x in names_at})
    assert min(np.diff(places)) > 9  # pt


@pytest.mark.parametrize(("subjects", "panels"), [(6, 6), (9, 6), (12, 6), (2, 2)])
def test_the_last_subject_of_each_column_has_the_names_of_the_conditions(
    subjects: int, panels: int
) -> None:
    names = ("one", "two")
    scores = {f"P{who}": tuple(np.array([5.0]) for _ in names) for who in range(subjects)}
    words = Words(name="people", title="", description="")
    means = np.array([5.0, 6.0])
    svg = drawing(partial(people_figure, names, scores, means, Scale(0, 10)), words).svg
    assert [svg.count(f">{name}<") for name in names] == [panels, panels]


def test_long_names_leave_room_for_the_axes_on_a_page_and_in_a_column() -> None:
    """A layout without room would be a warning, which is an error here."""
    name = "begins as all of them, and goes on"
    factors = {
        factor: tuple(f"{name} {number}" for number in range(many))
        for factor, many in {"condition": 30, "group": 6}.items()
    }
    words = Words(name="groups", title="Groups", description="")
    cells = np.full((30, 6), 5.0), np.ones((30, 6))
    means = drawing(partial(factor_figure, factors, *cells, "response", Scale(0, 11)), words)
    assert f"{name} 29<" in means.svg
    shares = {f"{name} {number}": np.full((30, 3), 0.5) for number in range(6)}
    for drawn in (means, drawing(partial(noticed_figure, factors["condition"], shares), words)):
        assert set(drawn.files()) == set(FORMATS)


def test_a_slow_computer_is_not_blamed_for_a_legend(monkeypatch: pytest.MonkeyPatch) -> None:
    # Matplotlib warns where it looks longer than a second for the best place.
    monkeypatch.setattr("matplotlib.legend.time.perf_counter", count(step=2).__next__)
    ends = np.array([0.0, 1.0])
    two = tuple(Series(label=label, x=ends, y=ends) for label in "ab")
    panel = Panel(title="", x_label="", y_label="", series=two)
    assert panels_files([panel], ["svg"])["svg"].startswith(b"<svg")
