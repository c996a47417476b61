"""The page on study files says what the schema says."""

import re
from pathlib import Path

from handbook.study_file import described_schema, study_file_page

PAGE = Path(__file__).parents[2] / "docs" / "study-file.md"


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == study_file_page(), (
        "run: python -m handbook.study_file > docs/study-file.md"
    )


def test_every_key_is_explained() -> None:
    page = PAGE.read_text(encoding="utf-8")
    schema = described_schema()
    for name, record in schema["$defs"].items():
        for key, entry in record["properties"].items():
            assert entry.get("description"), f"{name}.{key}"
            assert re.search(rf"^- `{key}(!| =|`)", page, re.MULTILINE), f"{name}.{key}"
