"""The published Table 4, imported and reported from the command line, with every known number."""

import json
import sys
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from touchbeam.cli.app import main

PUBLISHED = Path(__file__).parents[1] / "data" / "published_scores.csv"
CONDITIONS = ["frequency", "structure", "voltage", "direction", "pressure"]
LEVEL, GAIN = 8.78, [-10.43, 21.58]
"""Of the group, as an earlier run found them (regression)."""


def run_touchbeam(*arguments: str) -> None:
    before, sys.argv = sys.argv, ["touchbeam", *arguments]
    try:
        with pytest.raises(SystemExit, match="0"):
            main()
    finally:
        sys.argv = before


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    study = tmp_path_factory.mktemp("published") / "study"
    run_touchbeam("import", str(PUBLISHED), str(study))
    run_touchbeam("report", str(study), "--json")
    return study


@pytest.fixture(scope="module")
def numbers(folder: Path) -> Any:
    return json.loads((folder / "report" / "report.json").read_text())


def test_table_4(numbers: Any) -> None:
    table = numbers["table4"]
    assert table["columns"] == CONDITIONS
    assert [row["comprehensive"] for row in table["rows"]] == pytest.approx(
        [8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6]
    )
    assert [round(table["column_means"][name], 2) for name in CONDITIONS] == [
        8.44,
        8.89,
        9.67,
        8.33,
        6.22,
    ]
    assert round(table["grand_mean"], 2) == 8.31


def test_friedman_and_kendall(numbers: Any) -> None:
    test = numbers["friedman"]
    assert (round(test["chi2"], 6), test["df"]) == (21.452055, 4)
    assert test["p"] == pytest.approx(2.5757e-4, abs=5e-9)
    assert test["p_exact"] == pytest.approx(2.7104756944e-5, abs=1e-12)
    assert round(numbers["kendall_w"], 6) == 0.595890
    assert list(numbers["rank_sums"].values()) == [27, 32.5, 38.5, 25, 12]


def test_only_voltage_and_pressure_differ_after_holm(numbers: Any) -> None:
    pairs = numbers["pairwise"]
    assert len(pairs) == 10
    survive = [(pair["a"], pair["b"]) for pair in pairs if pair["p_holm"] < 0.05]
    assert survive == [("voltage", "pressure")]
    pair = next(pair for pair in pairs if pair["p_holm"] < 0.05)
    assert (pair["p"], pair["p_holm"], pair["method"]) == (0.00390625, 0.0390625, "exact")
    first = next(pair for pair in pairs if (pair["a"], pair["b"]) == ("frequency", "voltage"))
    assert (first["p"], first["n_zero"]) == (0.0625, 4)


def test_every_law_and_the_papers_own_ranking_are_tested(numbers: Any) -> None:
    laws = {score["law"]: score for score in numbers["laws"]}
    assert list(laws) == ["printed", "consistent", "coulomb", "paper's ranking"]
    consistent = laws["consistent"]
    assert consistent["order"] == ["direction", "voltage", "frequency", "structure", "pressure"]
    assert consistent["spearman"] == pytest.approx(0.3)
    assert consistent["p"] == pytest.approx(82 / 120)
    assert laws["paper's ranking"]["order"][0] == "voltage"
    assert laws["paper's ranking"]["order"][-1] == "pressure"
    assert laws["paper's ranking"]["log_evidence"] is None
    assert laws["paper's ranking"]["ln_bayes_factor_reason"] == "the claim predicts no contrasts"
    evidence = {law: laws[law]["log_evidence"] for law in ("printed", "consistent", "coulomb")}
    best = max(evidence.values())
    for law, value in evidence.items():
        assert laws[law]["ln_bayes_factor"] == pytest.approx(value - best)
    assert all(value > best - 3 for value in evidence.values()), "nine people tell no law apart"


def test_ties_are_shown_and_the_papers_ranking_is_called_circular_on_its_own_data(
    folder: Path, numbers: Any
) -> None:
    page = unescape((folder / "report" / "report.html").read_text())
    laws = {score["law"]: score for score in numbers["laws"]}
    assert laws["paper's ranking"]["order_tied"] == [
        ["voltage"],
        ["frequency", "structure", "direction"],
        ["pressure"],
    ]
    for order in (
        "voltage > frequency = structure = direction > pressure",
        "direction > structure = pressure > frequency > voltage",
    ):
        assert f'<td class="ranking">{order}</td>' in page
    assert "tested on the same data, it is circular and not evidence" in page


def test_the_page_says_what_laws_are_compared_by(folder: Path) -> None:
    page = unescape((folder / "report" / "report.html").read_text())
    for said in (
        "With 5 condition means and no ties, Spearman's rank correlation has p < .05 only if it is "
        "1 or −1.",
        "at −3 they are 20 times as probable under the best one",
    ):
        assert said in page


def test_every_subject_has_level_and_gain_within_their_intervals(numbers: Any) -> None:
    assert [line["subject"] for line in numbers["sensitivity"]] == [str(n) for n in range(1, 10)]
    for line in numbers["sensitivity"]:
        assert line["trials"] == 5
        for name in ("level", "gain", "bias", "relative_gain"):
            assert line[f"{name}_ci"][0] < line[name] < line[f"{name}_ci"][1]
        # Five scores of five conditions, most of them at the end of the scale.
        low, high = line["gain_ci"]
        assert (high - low) * numbers["rating"]["span"] > 0.5 * 10
        assert (line["told"], bool(line["reason"])) == (False, True)
    assert numbers["noticing"]["reason"] == "nobody was asked what changed"


def test_table_4_tells_levels_and_no_sensitivities(folder: Path, numbers: Any) -> None:
    rating = numbers["rating"]
    assert numbers["sensitivity_model"] == "rating", "nobody's answers were published"
    assert rating["told"] is False
    assert rating["group_level"] == pytest.approx(LEVEL, abs=0.01)
    assert rating["group_gain_ci"] == pytest.approx(GAIN, abs=0.02)
    assert 0.8 < rating["equal_gains"] < 0.95
    page = plain((folder / "report" / "report.html").read_text())
    low, high = (f"{end:.2f}".replace("-", "−") for end in rating["group_gain_ci"])
    assert f"95% CI [{low}, {high}], which includes 0." in page
    assert f"How sensitive each person is cannot be told from these data: {rating['reason']}." in (
        page
    )
    assert 'id="figure-people-levels"' in page
    assert 'id="figure-relative-gains"' not in page


def plain(page: str) -> str:
    return unescape(page).replace("\N{NO-BREAK SPACE}", " ")


def test_skin_is_named_wherever_a_gain_stands(folder: Path, numbers: Any) -> None:
    page = plain((folder / "report" / "report.html").read_text())
    short = "Without measured friction, a gain mixes skin with perception."
    for name in ("figure-model", "figure-sensitivity", "gains"):
        caption = page[page.index(f'id="{name}"') :].partition("caption>")[2].partition("caption>")
        assert short in caption[0], name
    assert numbers["sensitivity_note"] in page


def test_results_that_a_published_table_cannot_give_have_a_reason(numbers: Any) -> None:
    for name in ("order", "carry_over", "drift"):
        assert "order in which the scores were given" in numbers["checks"][name]["reason"]


def test_each_cell_has_its_trial_and_predictions(numbers: Any) -> None:
    assert len(numbers["trials"]) == 45
    trial = numbers["trials"][2]
    assert (trial["subject"], trial["condition"], trial["score"]) == ("1", "voltage", 10)
    assert round(trial["predicted"]["consistent"], 3) == 0.347


def test_the_same_table_imported_again_gives_the_same_bytes_and_prints_them(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "study"
    run_touchbeam("import", str(PUBLISHED), str(again))
    capsys.readouterr()
    run_touchbeam("report", str(again), "--out", str(tmp_path / "elsewhere"), "--json")
    assert capsys.readouterr().out == (folder / "report" / "report.json").read_text()
    written = {path.name: path.read_bytes() for path in (folder / "report").rglob("*.*")}
    assert {"table4.csv", "report.html", "report.json"} <= written.keys()
    assert written == {
        path.name: path.read_bytes() for path in (tmp_path / "elsewhere").rglob("*.*")
    }
