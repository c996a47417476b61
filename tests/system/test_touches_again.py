"""Trials with a touch that was not as instructed: they come again, and nothing of it is lost."""

from collections.abc import Callable
from pathlib import Path
from random import Random

from analysis.report.report import report_html, report_json
from protocol.journal.events import Answered, TrialDeferred, TrialStarted
from protocol.journal.state import folded
from protocol.study_file.loading import template
from runner.journal.opening import read_journal
from runner.journal.verification import verdicts
from tests.system.test_recovery import rehearsed

RETRIES = "\n[as_instructed]\nretries = 20\n"


def slips(seed: int, share: float = 1 / 3) -> Callable[[], bool]:
    stream = Random(seed)
    return lambda: stream.random() < share


def test_all_trials_are_answered_as_asked_in_the_end(tmp_path: Path) -> None:
    text = template("extended") + RETRIES
    found = rehearsed(tmp_path, text, 2, seed=1, slips=slips(4), shown=("checks",))
    with read_journal(tmp_path / "study.db") as journal:
        assert all(verdict.ok for verdict in verdicts(journal))
        chains = [journal.events(session) for session in journal.sessions()]
    deferred = 0
    for events in chains:
        records = [event.record for event in events]
        answered = [record for record in records if isinstance(record, Answered)]
        assert folded(events).name == "completed"
        asked = [answer for answer in answered if answer.kind != "practice"]
        assert all(not made.missed for answer in asked for made in answer.judged)
        again = [record for record in records if isinstance(record, TrialDeferred)]
        started = [record.index for record in records if isinstance(record, TrialStarted)]
        assert len(started) == len(answered) + len(again)
        assert all(record.missed == ("force",) for record in again)
        deferred += len(again)
    assert deferred > 5
    shown = report_json(found)["checks"]["as_run"]
    assert shown["attempts_repeated"] == deferred
    assert shown["problems"] == []
    total = sum(map(sum, shown["carry_over"]["counts"]))
    assert total > 0
    page = report_html(found)
    assert f"because a touch was not as instructed: {deferred}." in page
    assert "keeps every rule of the plan" in page


def test_the_last_attempt_counts_however_it_was_made(tmp_path: Path) -> None:
    text = template("paper") + RETRIES.replace("20", "1")
    rehearsed(tmp_path, text, 2, seed=1, slips=lambda: True, shown=("checks",))
    with read_journal(tmp_path / "study.db") as journal:
        events = [event.record for event in journal.events(journal.sessions()[0])]
    answered = [record for record in events if isinstance(record, Answered)]
    assert [record.index for record in events if isinstance(record, TrialDeferred)] != []
    assert sum(isinstance(record, TrialDeferred) for record in events) == len(answered) == 7
    assert all(made.missed == ("force",) for answer in answered for made in answer.judged)


def test_without_retries_the_first_attempt_counts(tmp_path: Path) -> None:
    rehearsed(tmp_path, template("paper"), 1, seed=1, slips=lambda: True, shown=("checks",))
    with read_journal(tmp_path / "study.db") as journal:
        tags = [event.tag for event in journal.events(journal.sessions()[0])]
    assert "trial-deferred" not in tags
    assert tags.count("answered") == 7


def test_practice_is_repeated_until_enough_touches_are_as_instructed(tmp_path: Path) -> None:
    text = template("extended") + "\n[as_instructed]\npractise_until = 3\npractise_of = 4\n"
    wrong = iter([True] * 6)
    rehearsed(tmp_path, text, 2, seed=1, slips=lambda: next(wrong, False), shown=("checks",))
    with read_journal(tmp_path / "study.db") as journal:
        assert verdicts(journal)[0].ok
        state = folded(journal.events(journal.sessions()[0]))
        tags = [event.tag for event in journal.events(journal.sessions()[0])]
    assert tags.count("practice-renewed") == state.practice_rounds - 1 >= 1
    assert sum(state.practised[-4:]) >= 3


def test_practice_ends_after_its_rounds(tmp_path: Path) -> None:
    text = template("extended") + "\n[as_instructed]\npractise_until = 3\npractise_of = 4\n"
    rehearsed(tmp_path, text, 2, seed=1, slips=lambda: True, shown=("checks",))
    with read_journal(tmp_path / "study.db") as journal:
        state = folded(journal.events(journal.sessions()[0]))
    assert (state.practice_rounds, state.name) == (3, "completed")
