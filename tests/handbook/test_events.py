"""The list of events in docs/journal.md, as generated from their records."""

from pathlib import Path

from handbook.events import event_list

PAGE = (Path(__file__).parents[2] / "docs" / "journal.md").read_text(encoding="utf-8")


def test_the_page_is_up_to_date() -> None:
    _, _, rest = PAGE.partition("## Events\n")
    section, _, _ = rest.partition("\n## ")
    assert f"## Events\n{section}" == event_list(), (
        "replace the section by the output of `python -m handbook.events`"
    )


def test_records_within_events_are_listed_once() -> None:
    assert PAGE.count("\n### Read back\n") == PAGE.count("\n### Planned trial\n") == 1
