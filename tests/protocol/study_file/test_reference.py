"""The page on study files says what the schema says."""

from pathlib import Path

from protocol.study.study import Study
from protocol.study_file.reference import study_file_page

PAGE = Path(__file__).parents[3] / "docs" / "study-file.md"


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == study_file_page(), (
        "run: python -m protocol.study_file.reference > docs/study-file.md"
    )


def test_every_key_is_explained() -> None:
    schema = Study.model_json_schema()
    for name, record in schema["$defs"].items():
        for key, entry in record["properties"].items():
            assert entry.get("description"), f"{name}.{key}"
            assert f"| `{key}` |" in PAGE.read_text(encoding="utf-8")
