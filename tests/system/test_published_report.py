"""The published Table 4, imported and reported from the command line, with every known number."""

import json
import re
import sys
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from touchbeam.cli.app import main

PUBLISHED = Path(__file__).parents[1] / "data" / "published_scores.csv"
CONDITIONS = ["frequency", "structure", "voltage", "direction", "pressure"]


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


def test_both_intraclass_correlations(numbers: Any) -> None:
    rounded = {
        target: [round(found[kind], 6) for kind in ("2,1", "3,1", "3,k")]
        for target, found in numbers["icc"].items()
    }
    assert rounded == {
        "subjects": [0.160075, 0.333333, 0.714286],
        "conditions": [0.519774, 0.618834, 0.935946],
    }


def test_additive_effects_and_gain_heterogeneity(numbers: Any) -> None:
    found = numbers["additive"]
    assert [round(found["conditions"][name], 4) for name in CONDITIONS] == [
        0.1333,
        0.5778,
        1.3556,
        0.0222,
        -2.0889,
    ]
    assert [round(effect, 3) for effect in found["subjects"].values()] == [
        0.289,
        0.689,
        -1.311,
        1.289,
        -0.511,
        0.689,
        -0.111,
        -0.311,
        -0.711,
    ]
    spreads = [round(found[name], 6) for name in ("residual_sd", "subject_sd", "shrinkage")]
    assert spreads == [0.971825, 0.687184, 0.714286]
    gains = numbers["gain_heterogeneity"]
    assert (gains["df"], gains["tau"]) == ([8, 24], 0)
    assert (round(gains["f"], 3), round(gains["p"], 3)) == (0.978, 0.372)


@pytest.mark.parametrize(
    ("link", "effects", "subject_sd", "log_likelihood"),
    [
        ("probit", (0.714, 1.896, -0.193, -2.439), 0.882, -44.5116),
        ("logit", (1.182, 3.187, -0.439, -4.582), 1.628, -44.7368),
    ],
)
def test_the_ordinal_mixed_model(
    numbers: Any, link: str, effects: tuple[float, ...], subject_sd: float, log_likelihood: float
) -> None:
    found = numbers["ordinal"][link]
    assert found["reference"] == "frequency"
    assert [found["effects"][name] for name in CONDITIONS[1:]] == pytest.approx(effects, abs=2e-3)
    assert found["subject_sd"] == pytest.approx(subject_sd, abs=2e-3)
    assert found["log_likelihood"] == pytest.approx(log_likelihood, abs=1e-4)


def test_every_law_and_the_papers_own_ranking_are_tested(numbers: Any) -> None:
    laws = {score["law"]: score for score in numbers["laws"]}
    assert list(laws) == ["printed", "consistent", "coulomb", "paper's ranking"]
    consistent = laws["consistent"]
    assert consistent["order"] == ["direction", "voltage", "frequency", "structure", "pressure"]
    assert consistent["spearman"] == pytest.approx(0.3)
    assert round(consistent["r_needed"], 3) == 0.878
    assert consistent["rho_needed"] == 1.0
    assert laws["paper's ranking"]["order"][0] == "voltage"
    assert laws["paper's ranking"]["order"][-1] == "pressure"
    assert all("log_likelihood" in laws[law]["who_felt_what"] for law in ("printed", "coulomb"))


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
    orders = {
        "none": "voltage > frequency = structure = direction > pressure",
        "0.97": "direction > structure = pressure > frequency > voltage",
    }
    for needed, order in orders.items():
        assert f'<td>{needed}</td><td class="ranking">{order}</td>' in page
    assert "tested on the same data, it is circular and not evidence" in page


def test_the_gain_of_a_law_has_cautions(folder: Path, numbers: Any) -> None:
    found = {score["law"]: score["who_felt_what"] for score in numbers["laws"]}
    assert found["consistent"]["gain_over_none"] == pytest.approx(3.446, abs=5e-4)
    assert found["consistent"]["gain_p"] == pytest.approx(47 / 120)
    assert found["coulomb"]["gain_p"] == pytest.approx(30 / 120)
    page = unescape((folder / "report" / "report.html").read_text())
    for caution in (
        "Conditions, not trials, are the units that tell laws apart.",
        "If p is large, arbitrary contrasts would fit as well;",
        "a law cannot explain who felt what",
        "M1 assumes that conditions differ only in the predicted contrast.",
    ):
        assert caution in page


def test_the_page_states_the_threshold_of_the_correlation_shown(folder: Path) -> None:
    page = unescape((folder / "report" / "report.html").read_text())
    assert (
        "With 5 condition means and no ties, Spearman's rank correlation (the one shown) has "
        "p < .05 only if it is 1 or −1 (Pearson's correlation of the contrasts and means must "
        "exceed 0.878)"
    ) in page


def test_every_subject_has_bias_and_gain_within_their_intervals(numbers: Any) -> None:
    assert [line["subject"] for line in numbers["sensitivity"]] == [str(n) for n in range(1, 10)]
    for line in (*numbers["sensitivity"], *numbers["sensitivity_simple"]["subjects"]):
        for name in ("gain", "bias", "relative_gain"):
            assert line[f"{name}_ci"][0] < line[name] < line[f"{name}_ci"][1]
        assert 0 < line["own_share"] < 1
    assert "catch" in numbers["sensitivity_models"]["M3"]["reason"]


def test_the_headline_is_the_ordinal_model_with_the_simple_one_beside_it(
    folder: Path, numbers: Any
) -> None:
    models = numbers["sensitivity_models"]
    assert numbers["sensitivity_model"] == "M2"
    assert numbers["sensitivity"] == models["M2"]["subjects"]
    assert numbers["sensitivity_simple"]["model"] == "M1"
    assert numbers["sensitivity_simple"]["subjects"] == models["M1"]["subjects"]
    assert "Do not use it where scores reach the highest" in numbers["sensitivity_simple"]["note"]
    assert all(models[name]["effective_points"] >= 200 for name in ("M1", "M2"))
    group = models["M2"]["population"]
    assert group["gain_ci"] == pytest.approx([-9.91, 22.17], abs=0.02)
    assert group["gain_sd_ci"][0] == 0
    assert group["gain_sd"] < group["gain_sd_upper"] < group["gain_sd_ci"][1]
    assert 0.85 < group["equal_gains"] < group["small_gain_sd"]["p"] < 0.92
    page = unescape((folder / "report" / "report.html").read_text())
    assert "95% interval [−9.91,\N{NO-BREAK SPACE}22.17], which includes 0." in page
    assert "Simple comparison: bias and gain by M1" in page


def test_the_jnd_of_the_published_table_has_no_upper_limit(folder: Path, numbers: Any) -> None:
    """No subject's gain is known to be positive."""
    assert all(line["gain_ci"][0] <= 0 for line in numbers["sensitivity"])
    assert [line["jnd_ci"][1] for line in numbers["sensitivity"]] == [None] * 9
    assert all(0 < line["jnd_ci"][0] < line["jnd"] for line in numbers["sensitivity"])
    page = unescape((folder / "report" / "report.html").read_text())
    assert page.count("\N{NO-BREAK SPACE}unbounded]") == 10


def test_skin_is_named_wherever_a_gain_stands(folder: Path, numbers: Any) -> None:
    page = unescape((folder / "report" / "report.html").read_text())
    short = "Without measured friction, a gain mixes skin with perception."
    page = re.sub(r"<strong>Figure \d+\.</strong> ", "", page)
    captions = [text.partition("</")[0] for text in page.split("caption>")[1:]]
    about = ("Sensitivity", "Ratings against the contrast", "Spread of gains", "Simple comparison")
    with_gains = [text for text in captions if text.startswith(about)]
    assert len(with_gains) == 5
    assert all(short in text for text in with_gains)
    numbers_said = "held the true gain in 60% of cases only"
    assert page.count(numbers_said) == 2
    assert numbers_said in numbers["sensitivity_note"]


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
