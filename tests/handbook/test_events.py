"""The page of the journal's events."""

from handbook.events import event_list


def test_records_within_events_are_listed_once() -> None:
    page = event_list()
    assert page.count("\n## Read back\n") == page.count("\n## Planned trial\n") == 1
