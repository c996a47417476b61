"""The report on imported scores: it says of them what is known, and predicts nothing."""

import numpy as np
import pytest

from analysis.report.blocks import Definitions
from analysis.report.report import Report, report, report_files, report_html
from analysis.report.results import paragraphs
from protocol.study_file.loading import parsed_study
from tests.analysis.reports import (
    NAMES,
    ORIGIN,
    SCORES,
    ReadPage,
    imported,
    plain_report,
    study_report,
)

TEXT = """
[study]
name = "table"
[session]
languages = ["en"]
[rating]
minimum = 4
maximum = 10
known = {known}
""" + "".join(f'[[condition]]\nname = "{name}"\n' for name in NAMES)


def of_scores(known: str) -> Report:
    return report("table", imported(SCORES), parsed_study(TEXT.format(known=known)), ORIGIN)


@pytest.mark.parametrize(
    ("known", "told"),
    [
        ("true", "Four participants rated three conditions from 4 to 10."),
        ("false", "Four participants gave three conditions scores, 4 to 10."),
    ],
)
def test_a_scale_is_told_as_far_as_it_is_known(known: str, told: str) -> None:
    found = of_scores(known)
    assert dict(paragraphs(found))["Do the conditions differ?"].startswith(told)
    assert ("ends of the scale are not known" in report_html(found)) == (known == "false")


def test_nothing_is_predicted_of_scores_without_contrasts() -> None:
    found = of_scores("true")
    assert not found.is_predicted
    page = " ".join(ReadPage(report_html(found)).words)
    for word in ("predicted", "friction", "Sensitivity", "Table 4", "comprehensive"):
        assert word not in page, word


def test_the_ends_of_a_scale_have_the_sign_of_all_numbers_of_the_page() -> None:
    study = parsed_study(TEXT.format(known="true").replace("minimum = 4", "minimum = -5"))
    found = report("table", imported(SCORES), study, ORIGIN)
    page = report_html(found)
    assert "from −5 to 10" in page
    assert "Scores by subject and condition, −5 to 10." in page
    assert "-5 to 10" not in page
    assert "-5 to 10" in report_files(found, figures=False)["table4.tex"].decode()


def test_laws_are_compared_with_what_was_given() -> None:
    assert "Each friction law compared with ratings." in report_html(plain_report())
    assert "Each friction law compared with answers and ratings." in report_html(study_report())


def terms(found: Report) -> set[str]:
    """The terms that the glossary explains."""
    (section,) = (each for each in found.sections if each.name == "glossary")
    (known,) = section.blocks
    assert isinstance(known, Definitions)
    return set(known.entries)


def test_the_glossary_explains_what_stands_on_the_page_alone() -> None:
    of_tests = {"95% CI", "Holm's correction", "Kendall's W", "p", "r"}
    assert terms(of_scores("true")) == of_tests
    # Scores of the paper have predictions, and nobody's answers.
    of_model = {"contrast", "gain", "law", "level", "relative gain", "rung"}
    assert terms(plain_report()) == of_tests | of_model
    asked = terms(study_report())
    assert of_tests | of_model | {"as expected", "response"} <= asked
    page = " ".join(ReadPage(report_html(of_scores("true"))).words)
    for word in ("as expected", "response", "published", "noticed", "level, gain"):
        assert word not in page, word


def test_a_table_of_one_condition_explains_no_test_of_several() -> None:
    one = parsed_study(TEXT.format(known="true"))
    found = report("table", imported(np.array(SCORES)[:, :1], names=NAMES[:1]), one, ORIGIN)
    assert not terms(found) & {"Kendall's W", "r"}


def test_missing_scores_are_counted() -> None:
    holes = [[np.nan, *SCORES[0][1:]], *SCORES[1:]]
    found = report("table", imported(holes), parsed_study(TEXT.format(known="true")), ORIGIN)
    assert "1 of 12 scores are missing; means are of those given." in report_html(found)
    assert "are missing" not in report_html(of_scores("true"))
