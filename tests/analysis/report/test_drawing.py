"""The report's figures: names that they can write, and the scale of the scores."""

from tests.analysis.reports import (
    SCORES,
    made,
)


def test_names_that_the_figures_font_lacks_are_numbered_and_dollars_are_no_formulas() -> None:
    drawing = made(SCORES[:1], names=("电压", "$a^$", "pressure")).figures[0].drawing
    assert drawing is not None
    assert "<!-- condition 1 -->" in drawing.svg
    assert "<!-- $a^$ -->" in drawing.svg
