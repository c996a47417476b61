"""What people do at a desk beside the rig: they take decisions back, and they make mistakes."""

import json
import random
import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

from protocol.study_file.loading import text_digest
from tests.system.day.invariants import require
from touchbeam.cli import journal as commands

if TYPE_CHECKING:
    from tests.system.day.day import Day

Mistake = tuple[Callable[[], None], str]
"""A command that must be refused, and what it must say, as a regular expression."""
STRANGER = "P99"


def at_the_desk(day: "Day", stream: random.Random) -> None:
    """Take a decision back, or give a command that must be refused and change nothing."""
    names = sorted(day.lab.watch.planned)
    if not names:
        return
    if (decisions := list(_decisions(day))) and stream.random() < 0.5:
        _taken_back(day, *stream.choice(decisions))
    else:
        _mistaken(day, *stream.choice(list(_mistakes(day, stream.choice(names)))))
    day.happened["command"] += 1


def _decisions(day: "Day") -> Iterator[tuple[str, int | None]]:
    """Yield each excluded session, and each excluded trial of another, that may be included."""
    lost = day.withdrawn | day.doubtful
    yield from ((name, None) for name in sorted(day.gone) if name.partition("/")[0] not in lost)
    yield from (place for place in sorted(day.excluded_trials) if place[0] not in day.gone)


def _taken_back(day: "Day", name: str, trial: int | None) -> None:
    outcome = day.lab.command(lambda: _include(day, name, trial))
    day.refused_while_running(name, outcome)
    # A session that was killed stands where it was, armed or in a trial, until it goes on.
    day.may_fail(outcome, "is interrupted; it cannot be included now" in outcome.line)
    if outcome.code != 0:
        return
    if trial is None:
        day.gone.remove(name)
        day.returned.add(name)
    else:
        day.excluded_trials.remove((name, trial))


def _include(day: "Day", name: str, trial: int | None) -> None:
    participant, number = name.split("/")
    commands.include(
        study=day.lab.folder.path,
        participant=participant,
        session=int(number),
        trial=trial,
        reason="it was no slip",
    )


def _exclude(day: "Day", name: str, trial: int | None) -> None:
    participant, number = name.split("/")
    commands.exclude(
        study=day.lab.folder.path,
        participant=participant,
        session=int(number),
        trial=trial,
        reason="by mistake",
    )


def _mistakes(day: "Day", name: str) -> Iterator[Mistake]:
    folder = day.lab.folder.path
    yield lambda: _exclude(day, f"{STRANGER}/1", None), f"no session {STRANGER}/1 here"
    yield (
        lambda: commands.withdraw(study=folder, participant=STRANGER, yes=True),
        f"{STRANGER} has no sessions here",
    )
    if _last_accepted(day) == text_digest(day.lab.text):
        yield lambda: commands.amend(study=folder, reason="none"), "has not changed"
    if name.partition("/")[0] in day.withdrawn | day.doubtful:
        return
    planned = sorted(day.lab.watch.planned[name])
    span = f"has no trial {planned[-1] + 1}; it has trials {planned[0]} to {planned[-1]}"
    yield lambda: _exclude(day, name, planned[-1] + 1), span
    excluded = sorted(trial for session, trial in day.excluded_trials if session == name)
    for trial in excluded[:1]:
        again = partial(_exclude, day, name, trial)
        yield again, f"trial {trial} of {name} is already excluded"
    for trial in sorted(set(planned) - set(excluded))[:1]:
        early = partial(_include, day, name, trial)
        yield early, f"trial {trial} of {name} is not excluded"
    if name not in day.gone:
        hint = "[^;]*; its excluded trials are .*--trial" if excluded else "[^;]*$"
        yield lambda: _include(day, name, None), f"{name} is .*, not excluded{hint}"


def _mistaken(day: "Day", work: Callable[[], None], says: str) -> None:
    before = _stored(day)
    outcome = day.lab.command(work)
    told = outcome.code == 2 and re.search(says, outcome.line)
    require(11, told or (outcome.code == 1 and day.running), f"not {says!r}: {outcome.line}")
    require(2, _stored(day) == before, f"refused, but stored: {outcome.line}")


def _last_accepted(day: "Day") -> str:
    """Return the digest of the study file that was accepted last.

    A session that begins as the study is amended may still be one of the study before.
    """
    accepted = [
        json.loads(payload)["study_sha256"]
        for (payload,) in _rows(
            day,
            "SELECT payload FROM event WHERE tag IN ('session-opened', 'study-amended')"
            " AND payload IS NOT NULL ORDER BY rowid",
        )
    ]
    return accepted[-1] if accepted else ""


def _stored(day: "Day") -> int:
    """Return how many events there are."""
    ((count,),) = _rows(day, "SELECT count(*) FROM event")
    return int(count)


def _rows(day: "Day", query: str) -> list[tuple[Any, ...]]:
    with closing(sqlite3.Connection(day.lab.folder.journal)) as connection:
        return connection.execute(query).fetchall()
