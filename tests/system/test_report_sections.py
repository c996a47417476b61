"""Which sections the report's page shows: all, those of report.toml, or those that are named."""

import json
import webbrowser
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import pytest

import touchbeam
from analysis.report.page import SECTIONS
from analysis.report.report import report, report_files
from tests.analysis.reports import study_report
from tests.runner.command_line import typed

PUBLISHED = Path(__file__).parents[1] / "data" / "published_scores.csv"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("chosen") / "study"
    assert typed("import", PUBLISHED, made) == 0
    return made


def shown(study: Path) -> list[str]:
    page = (study / "report" / "report.html").read_text(encoding="utf-8")
    return [part.partition('"')[0] for part in page.split('<details id="h-')[1:]]


def command(study: Path) -> str:
    told = json.loads((study / "report" / "report.json").read_text(encoding="utf-8"))
    return str(told["provenance"]["command"])


def test_sections_are_chosen_by_file_and_by_name(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert typed("report", study, "--open") == 0
    whole = (study / "report" / "report.json").read_bytes()
    assert {"methods", "glossary", "trials"} < set(shown(study))
    assert opened == [(study / "report" / "report.html").resolve().as_uri()]
    (study / "report.toml").write_text('sections = ["trials", "methods"]\n')
    assert typed("report", study) == 0
    assert shown(study) == ["trials", "methods"]
    assert (study / "report" / "report.json").read_bytes() == whole
    assert typed("report", study, "--sections", "glossary") == 0
    assert shown(study) == ["glossary"]
    assert command(study) == "touchbeam report study --sections glossary"
    assert typed("report", study, "--sections", "trials, glossary,trials") == 0
    assert shown(study) == ["trials", "glossary"]


@pytest.mark.usefixtures("figures_as_svg")
def test_named_sections_alone_are_computed_and_old_figures_are_removed(study: Path) -> None:
    assert typed("report", study) == 0
    plain = (study / "report" / "report.json").read_bytes()
    assert typed("report", study, "--figures", "--sections", "tests,methods") == 0
    assert shown(study) == ["tests", "methods"]
    numbers = json.loads((study / "report" / "report.json").read_text())
    assert command(study) == "touchbeam report study --sections tests,methods"
    numbers["provenance"]["command"] = "touchbeam report study"
    assert numbers.items() <= json.loads(plain).items()
    assert {"table4", "provenance", "pairwise"} < numbers.keys()
    assert not {"sensitivity", "laws", "trials"} & numbers.keys()
    drawn = study / "report" / "figures" / "people.pdf"
    assert drawn.exists()
    touchbeam.load(study).report(sections="tests", figures=True)
    assert drawn.exists()
    assert shown(study) == ["tests"]
    assert command(study) == "touchbeam report study --sections tests"
    assert typed("report", study) == 0
    assert not drawn.exists()
    assert (study / "report" / "report.json").read_bytes() == plain


def test_a_section_of_an_earlier_version_is_left_out_with_a_warning(study: Path) -> None:
    chosen = study / "report.toml"
    chosen.write_text('sections = ["multiverse", "predictive", "glossary"]\n')
    left = "multiverse, predictive"
    said = f"report.toml: sections that only earlier versions had are left out: {left}"
    try:
        with pytest.warns(UserWarning, match=said):
            touchbeam.load(study).report()
        assert shown(study) == ["glossary"]
        chosen.write_text('sections = ["multiverse", "predictive"]\n')
        with pytest.warns(UserWarning, match=f"{said}; all sections are shown"):
            touchbeam.load(study).report()
        assert typed("report", study, "--sections", "multiverse") == 2
    finally:
        chosen.unlink()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("sections = [", "report.toml:1: file: must be TOML, got the line"),
        ("sections = " + "9" * 5000, "report.toml: file: nothing may be nested"),
        ('titles = ["a"]', "must have one key"),
        ('sections = ["metods"]', "no section 'metods'; there are table4, methods"),
    ],
)
def test_a_wrong_choice_is_refused_in_one_line(
    study: Path, given: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (study / "report.toml").write_text(given)
    assert typed("report", study) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


def test_an_unknown_section_is_refused_before_anything_is_read(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (study / "report.toml").unlink(missing_ok=True)
    (study / "study.toml").rename(study / "away.toml")
    try:
        assert typed("report", study, "--sections", "trials,metods") == 2
    finally:
        (study / "away.toml").rename(study / "study.toml")
    assert "no section 'metods'; there are table4, methods" in capsys.readouterr().err


def computed(results: object) -> set[str]:
    """Return the names of the results that were asked for."""
    return {
        name
        for name in vars(results)
        if isinstance(getattr(type(results), name, None), cached_property)
    }


def test_what_is_not_shown_is_not_fitted() -> None:
    given, named = study_report(), ("glossary", "trials")
    origin = replace(given.origin, alone=True)
    made = report("a", given.loaded, given.study, origin, named)
    files = report_files(made, figures=True)
    # The results in words and their figures stand on every page.
    assert computed(made.table) == {"table4"}
    given_once = {"contrasts", "scored", "noticed", "crossed", "factorial", "orders", "_means"}
    given_once |= {"responses", "response_tests", "slope", "predicted", "directions"}
    given_once |= {"level_slope", "answered"}
    assert computed(made.trials) == given_once, "no law is fitted, no order tested"
    assert {"sensitivity", "predictor"} <= computed(made), "what people are told of stands in front"
    assert made.trials.factorial is None, "it has no factors"
    drawn = {path.removesuffix(".svg") for path in files if path.endswith(".svg")}
    assert drawn == {f"figures/{name}" for name in ("scores", "model", "people-levels")}


def test_sections_have_the_names_by_which_they_are_chosen() -> None:
    made = study_report()
    assert [section.name for section in made.sections] == list(SECTIONS)
