"""Trials come again, and practice too, where touches were not as instructed."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from device.drivers.limits import Setpoint
from protocol.journal.events import Event, PracticeRenewed, TrialDeferred
from protocol.journal.records import ReadBack
from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.screens import Notice, Screen
from runner.session.loop import run
from runner.session.session import SessionContext
from tests.runner.fakes import FakeDevice, FakeParticipant, context


@dataclass
class Slipping(FakeDevice):
    """A device whose finger presses much too hard in the touches that `slips` tells."""

    slips: Iterator[bool] = field(default_factory=lambda: iter(()))
    force_n: float = 0.5

    def drive(self, setpoint: Setpoint) -> ReadBack:
        if not self.on:
            self.force_n = 5.0 if next(self.slips, False) else 0.5
        return super().drive(setpoint)

    def read_back(self) -> ReadBack:
        return replace(super().read_back(), force_n=self.force_n)


@dataclass
class Watching(FakeParticipant):
    """A participant who looks at the clock at each screen."""

    made: SessionContext | None = None
    at_s: list[float] = field(default_factory=list)

    def show(self, screen: Screen) -> None:
        super().show(screen)
        if self.made is not None:
            self.at_s.append(self.made.clock.monotonic_s())

    def lasted_s(self, notice: str) -> list[float]:
        """How long each notice with this text stood."""
        pairs = zip(self.shown, self.at_s, self.at_s[1:], strict=False)
        return [after - at for screen, at, after in pairs if screen == Notice(text=notice)]


def done(folder: Path, text: str, *slips: bool) -> tuple[list[Event], Watching]:
    """The events of a session in which these touches go wrong, and who took part."""
    participant = Watching()
    with open_journal(folder / "study.db") as journal:
        made = context(journal, Slipping(slips=iter(slips)), participant, text)
        participant.made = made
        run(made)
        return [event.record for event in journal.events("P01/1")], participant


def deferred(events: list[Event]) -> list[int]:
    return [event.index for event in events if isinstance(event, TrialDeferred)]


RULES = "\n[as_instructed]\nforce_within = 2.0\nplace_within_m = 0.1\npath_within = 10.0\n"
"""Nothing but a force that is much too high is wrong."""
ONCE = f"{template('paper')}{RULES}retries = 1\n"


@pytest.mark.parametrize("retries", [0, 1, 2])
def test_each_trial_comes_again_as_often_as_the_study_says(tmp_path: Path, retries: int) -> None:
    """Each trial has its own count."""
    text = f"{template('paper')}{RULES}retries = {retries}\n"
    events, participant = done(tmp_path, text, *[True] * (2 * retries + 2), False)
    again = [event for event in events if isinstance(event, TrialDeferred)]
    assert sorted((event.index, event.missed) for event in again) == [
        (index, ("force",)) for index in (0, 1) for _ in range(retries)
    ]
    lasted_s = participant.lasted_s("again.force")
    told = "the notice also stands during part of the pause"
    assert lasted_s == pytest.approx([3.5] * 2 * retries), told


def test_what_is_as_instructed_does_not_come_again(tmp_path: Path) -> None:
    events, participant = done(tmp_path, ONCE)
    assert deferred(events) == []
    assert participant.lasted_s("again.force") == []


def test_a_trial_that_comes_again_asks_nothing_the_first_time(tmp_path: Path) -> None:
    events, _ = done(tmp_path, ONCE, True)
    tags = [event.TAG for event in events]
    place = tags.index("trial-deferred")
    assert tags[place - 1] == "touch-ended"
    assert tags[place + 1] == "trial-started"
    assert tags.count("trial-started") == tags.count("answered") + 1


PRACTISED = (
    f"{template('extended')}{RULES}"
    "retries = 3\npractise_until = 1\npractise_of = 2\npractice_rounds = 3\n"
)


OPENINGS, PRACTICE = 2, 6
"""Number of touches before practice, and in its three trials."""
ALL = (2, 3, 4)
"""The trials of practice, by their indices."""


def practised(folder: Path, *slips: bool) -> list[Event]:
    """The events of a session in which these touches of practice go wrong."""
    return done(folder, PRACTISED, *[False] * OPENINGS, *slips)[0]


def renewed(events: list[Event]) -> list[tuple[int, ...]]:
    return [event.indices for event in events if isinstance(event, PracticeRenewed)]


def test_practice_is_no_trial_that_comes_again(tmp_path: Path) -> None:
    assert deferred(practised(tmp_path, True)) == []


@pytest.mark.parametrize(("wrong", "rounds"), [(0, 0), (1, 0), (2, 1)])
def test_practice_is_renewed_if_too_few_of_its_last_touches_were_right(
    tmp_path: Path, wrong: int, rounds: int
) -> None:
    events = practised(tmp_path, *[False] * (PRACTICE - wrong), *[True] * wrong)
    assert renewed(events) == [ALL] * rounds


def test_practice_is_renewed_once_it_is_over_and_not_for_ever(tmp_path: Path) -> None:
    events = practised(tmp_path, *[True] * (3 * PRACTICE))
    assert renewed(events) == [ALL, ALL]
    tags = [event.TAG for event in events]
    assert tags[: tags.index("practice-renewed")].count("answered") == OPENINGS + len(ALL)


def test_practice_may_be_all_that_there_was_so_far(tmp_path: Path) -> None:
    unopened = re.sub(r"(?ms)^\[\[opening\]\].*?(?=^\[)", "", PRACTISED)
    events, _ = done(tmp_path, unopened, *[True] * PRACTICE)
    assert renewed(events) == [(0, 1, 2)]
