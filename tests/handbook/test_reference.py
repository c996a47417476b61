"""Reference pages say what the code says."""

import re

import pytest

from analysis.report.report import report_json
from handbook.reference import FOLDER, PAGES
from tests.analysis.reports import plain_report, study_report


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_up_to_date(name: str) -> None:
    page = (FOLDER / name).read_text(encoding="utf-8")
    assert page == f"{PAGES[name]().rstrip()}\n", "run: python -m handbook.reference"


def test_every_key_of_the_report_is_explained() -> None:
    page = (FOLDER / "report-json.md").read_text(encoding="utf-8")
    explained = set(re.findall(r"`(\w+)`", page))
    keys = {*report_json(plain_report()), *report_json(study_report())}
    assert {key.removesuffix("_reason") for key in keys} - explained == set()
