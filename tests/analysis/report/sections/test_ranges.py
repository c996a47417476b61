"""Ranges of the contrasts, on the page and in the JSON."""

from analysis.report.report import report_html, report_json
from device.friction.rungs import TOP_RUNG
from tests.analysis.reports import made

NAMES = ("frequency", "structure", "voltage", "direction", "pressure")
SCORES = [[7, 8, 9, 6, 5], [8, 7, 9, 7, 6], [6, 8, 8, 8, 4], [7, 9, 10, 6, 6]]


def test_law_rung_kind_and_ranges_stand_beside_the_contrasts() -> None:
    result = made(SCORES * 4, names=NAMES)
    numbers, page = report_json(result), report_html(result)
    assert (numbers["contrast_law"], numbers["contrast_rung"]) == ("consistent", TOP_RUNG)
    ranges = {entry["condition"]: entry for entry in numbers["contrast_ranges"]}
    assert list(ranges) == list(NAMES)
    assert ranges["frequency"]["kind"] == "growth of a swing"
    assert ranges["voltage"]["by_rung"][TOP_RUNG] == ranges["voltage"]["value"]
    for words in ("growth of a swing", "over a path", "at a place", f"rung {TOP_RUNG}"):
        assert words in page
