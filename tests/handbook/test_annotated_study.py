"""The study file with comments: what it leaves out, and that each of its keys is explained.

The tests of the examples check and rehearse it.
"""

import re
import tomllib

import pytest

from handbook.build import ROOT
from handbook.study_file import described_schema

FILE = ROOT / "docs" / "assets" / "annotated-study.toml"
TEXT = FILE.read_text(encoding="utf-8")
STUDY = tomllib.loads(TEXT)
# Files beside the study file, as the page says.
ELSEWHERE = {"languages", "pictures", "tables"}
SCHEMA = described_schema()


def test_it_has_every_section_of_a_study_file() -> None:
    assert set(SCHEMA["properties"]) - set(STUDY) <= ELSEWHERE


@pytest.mark.parametrize("key", ["kind", "when"])
def test_its_questions_are_of_many_kinds(key: str) -> None:
    choices = set(SCHEMA["$defs"]["StudyQuestion"]["properties"][key]["enum"])
    said = {question.get(key, "trial") for question in STUDY["question"]}
    # Those that are missing stand in its comments.
    assert choices - said <= set(re.findall(r'"(\w+)"', TEXT))


def test_most_of_its_keys_have_a_comment() -> None:
    keys = re.findall(r"^\w+ = .*", TEXT, re.MULTILINE)
    told = [key for key in keys if "# " in key]
    assert len(told) > 0.5 * len(keys) > 40
