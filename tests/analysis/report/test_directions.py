"""Which way changes were answered: the first thing that page and terminal say where it is wrong."""

from collections.abc import Callable

import pytest
from scipy import stats

from analysis.loading.response import Directions
from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.results import DIFFER, TOGETHER, WHICH_WAY, contrary_lines, paragraphs
from tests.analysis.chains import asked_session, chain
from tests.analysis.reports import ORIGIN, PAPER, plain_report, study_report
from touchbeam.cli.results import _print_results

NAMES = ("voltage", "structure", "pressure")
ASKED = f"<strong>{WHICH_WAY}</strong>"
Answers = Callable[[int], list[tuple[str, str, int | None]]]


def answered(answers: Answers) -> Report:
    """A report of six people, each with the answers of their number."""
    chains = [chain(asked_session(f"P{who}", answers(who), NAMES)) for who in range(6)]
    return report("a study", load_study_data(chains, rehearsals=False), PAPER, ORIGIN)


def wrong(who: int) -> list[tuple[str, str, int | None]]:
    """Of twelve answers on voltage ten go the other way, of six on structure three and two."""
    ways = ["smoother"] * 2 + ["rougher"] * 3 + ["same"]
    return [
        ("voltage", "rougher", None),
        ("voltage", "same" if who < 2 else "rougher", None),
        ("structure", ways[who], 4 + who if ways[who] == "smoother" else None),
        ("pressure", "smoother", 3 + who % 4),
    ]


def as_expected(who: int) -> list[tuple[str, str, int | None]]:
    """As many answers the other way as expected are no finding, nor are those of no change."""
    even = ("rougher", None) if who % 2 else ("smoother", 5)
    return [
        *(("voltage", "smoother", 5 + who % 3), ("structure", *even)),
        ("pressure", "smoother" if who == 0 else "same", 5 if who == 0 else None),
    ]


SAID = [
    "Voltage: none of 12 answers as expected, 10 the other way.",
    "These answers count as 0 in the tests.",
    "Look at the expected answer of voltage in the study file, at the wiring and at the drive.",
]


def test_changes_felt_the_other_way_are_the_first_thing_on_the_page() -> None:
    found = answered(wrong)
    assert contrary_lines(found) == SAID
    first, *others = paragraphs(found)
    assert first == (WHICH_WAY, " ".join(SAID))
    assert DIFFER in dict(others)
    page = report_html(found)
    results = page.partition('<h2 id="results">')[2]
    assert results.index("<strong>") == results.index(ASKED)
    assert f"{ASKED} {' '.join(SAID)}</p>" in results.partition('<h2 id="details">')[0]
    assert report_json(found)["directions"] == [
        {"condition": "voltage", "expected": 0, "contrary": 10, "same": 2},
        {"condition": "structure", "expected": 2, "contrary": 3, "same": 1},
        {"condition": "pressure", "expected": 6, "contrary": 0, "same": 0},
    ]


def test_the_terminal_says_it_before_table_4(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _print_results(answered(wrong))
    shown = " ".join(capsys.readouterr().out.split())
    places = [shown.index(said) for said in (*SAID, "average", "Responses. Friedman")]
    assert places == sorted(places)


@pytest.mark.parametrize(
    "made", [lambda: answered(as_expected), study_report, plain_report], ids=["even", "own", "none"]
)
def test_a_study_answered_as_expected_says_nothing_of_it(
    made: Callable[[], Report], capsys: pytest.CaptureFixture[str]
) -> None:
    found = made()
    assert contrary_lines(found) == []
    assert WHICH_WAY not in dict(paragraphs(found))
    assert WHICH_WAY not in report_html(found)
    first = next(iter(dict(paragraphs(found))))
    assert first in {TOGETHER, DIFFER}
    _print_results(found)
    assert "the other way." not in capsys.readouterr().out


def test_answers_turned_round_turn_the_directions() -> None:
    turned = {"smoother": "rougher", "rougher": "smoother", "same": "same"}

    def mirrored(who: int) -> list[tuple[str, str, int | None]]:
        return [(name, turned[way], None) for name, way, _ in wrong(who)]

    ways, back = (report_json(answered(each))["directions"] for each in (wrong, mirrored))
    for one, other in zip(ways, back, strict=True):
        assert (one["expected"], one["contrary"]) == (other["contrary"], other["expected"])
        assert one["same"] == other["same"]
    told = contrary_lines(answered(mirrored))
    assert told[0] == "Pressure: none of 6 answers as expected, 6 the other way."


@pytest.mark.parametrize(
    ("expected", "contrary", "told"),
    [(0, 4, False), (0, 5, True), (1, 6, False), (1, 7, True), (5, 6, False), (20, 40, True)],
)
def test_directions_that_chance_explains_are_not_told(
    expected: int, contrary: int, told: bool
) -> None:
    """The sign test, one-sided: where nobody feels anything, either way is as likely."""
    p = float(stats.binomtest(contrary, contrary + expected, alternative="greater").pvalue)
    assert (p < 0.05) is told
    assert Directions(expected=expected, contrary=contrary, same=3).is_contrary is told
