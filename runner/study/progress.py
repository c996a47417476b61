"""The progress of a study: what became of each session, and what to do next, in words."""

import re
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path
from typing import Any

from protocol.errors import typed_as
from protocol.journal.events import NOBODY, SCRIPT, SLIDE, ScoresImported, SessionOpened
from protocol.journal.state import SessionState, in_words
from protocol.plan.plan import plan
from protocol.study.study import Study
from runner.journal import cohort
from runner.journal.names import REHEARSAL, parsed_name, session_name

_OVER = ("completed", "excluded", "withdrawn")
# The default of the study file, for a study whose file cannot be read now.
_RESUME_WITHIN_H = 24.0


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The sessions of a study at `now`; `running` are the spoken names of those that run."""

    folder: Path
    study: Study | None
    sessions: Mapping[str, SessionState]
    running: Set[str]
    now: datetime
    program: str = "touchbeam"
    """As it is typed here."""
    accepted: bool = True
    """Whether the study file is the one that sessions go on with."""
    unusable: str = ""
    """Why no session can begin or go on now; '' if one can."""

    @property
    def next_slot(self) -> int | None:
        """The slot of the design that the next participant gets; with groups there are several."""
        grouped = self.study is not None and self.study.group
        return None if grouped else cohort.Arrival(self.sessions, "", "participant").slot()

    @property
    def groups(self) -> list[dict[str, Any]]:
        """Each group of the study: its size, how many of it are done, and its next slot."""
        return [
            {
                "name": group.name,
                "planned": group.size,
                "done": sum(
                    self._is_done(who) and any(it.group == group.name for it in had)
                    for who, had in self._had.items()
                ),
                "next_slot": cohort.Arrival(self.sessions, "", "participant").slot(group.name),
            }
            for group in (self.study.group if self.study is not None else ())
        ]

    @property
    def participants(self) -> list[str]:
        """Everybody who has a session here, in the order of the first one."""
        return list(self._had)

    @cached_property  # it is asked for again for each participant
    def _had(self) -> dict[str, list[cohort.SessionSummary]]:
        """The sessions that each participant had, without rehearsals, slides and scripts."""
        had: dict[str, list[cohort.SessionSummary]] = {}
        for each in self.summaries:
            if each.kind not in {REHEARSAL, *NOBODY}:
                had.setdefault(each.participant, []).append(each)
        return had

    @cached_property
    def summaries(self) -> list[cohort.SessionSummary]:
        """One of each session, in the order of `sessions`."""
        return cohort.session_summaries(self.sessions)

    def records(self) -> list[dict[str, Any]]:
        """Return what became of each session, for programs."""
        return [
            {
                **summary.record(),
                "resume_before_utc": (until := self.resume_before(state)) and until.isoformat(),
                "next_due_utc": [
                    each.isoformat()
                    for each in self.next_due(summary, state) or ()
                    if each < cohort.NEVER
                ],
            }
            for summary, state in zip(self.summaries, self.sessions.values(), strict=True)
        ]

    @property
    def next_participant(self) -> str:
        """A pseudonym for the next participant: the last one's with the next number."""
        return _next_pseudonym(self._had)

    @property
    def planned(self) -> int | None:
        return None if self.study is None else self.study.design.participants

    @property
    def done(self) -> int:
        """The number of participants with as many completed sessions as the study plans."""
        return sum(map(self._is_done, self._had))

    @property
    def _each(self) -> int:
        return 1 if self.study is None else self.study.design.sessions

    def _completed(self, participant: str) -> int:
        return sum(each.state == "completed" for each in self._had.get(participant, ()))

    def _is_done(self, participant: str) -> bool:
        return self._completed(participant) >= self._each

    def _is_latest(self, summary: cohort.SessionSummary) -> bool:
        return summary in self._had.get(summary.participant, [])[-1:]

    def resume_before(self, state: SessionState) -> datetime | None:
        """Return until when an unfinished session may be resumed."""
        script = state.opened is not None and state.opened.kind == SCRIPT
        over = script or state.shown_name in _OVER or self._cannot_go_on(state)
        if over or state.last_event_utc is None:
            return None
        rules = self.study.session if self.study is not None else None
        hours = _RESUME_WITHIN_H if rules is None else rules.resume_within_h
        return state.last_event_utc + timedelta(hours=hours)

    def lines(self) -> Iterator[str]:
        """Yield what became of each session, then what to do next."""
        for chain, summary in zip(self.sessions, self.summaries, strict=True):
            state = self.sessions[chain]
            name = session_name(summary.participant, summary.session)
            now = in_words(state.name, running=parsed_name(chain).plain in self.running)
            unit = "passes" if summary.participant == SLIDE else "trials"
            excluded = f", {summary.excluded_trials} excluded" if summary.excluded_trials else ""
            noted = f"; noted: {state.noted}" if state.described else ""
            of = f" of {summary.group}" if summary.group else ""
            counted = summary.kind not in {SCRIPT, ScoresImported.kind}
            done = f"  {summary.answered} of {summary.planned} {unit}" * counted
            yield (
                f"{name}  {summary.kind}{of}  {now}{done}{excluded}{noted}"
                f"{self._advice(chain, state)}{self._next_session(summary, state)}"
            )
        yield self._cohort()

    def stranded(self) -> Iterator[str]:
        """Yield each session that the study as it is now leaves unfinished, and what to do."""
        for chain, state in self.sessions.items():
            if self._cannot_go_on(state):
                yield parsed_name(chain).plain + self._advice(chain, state).replace(";", "", 1)

    def _cannot_go_on(self, state: SessionState) -> str:
        """Return why the study as it is now leaves a session unfinished; '' if it does not."""
        opened = state.opened
        if self.study is None or not self.accepted or state.shown_name in _OVER:
            return ""
        # Nobody has no slot, and without its plan there is nothing to compare.
        if not isinstance(opened, SessionOpened) or opened.slot is None or not state.planned:
            return ""
        study = self.study.of_group(opened.group)
        trials = plan(study, opened.slot, opened.session).trials
        return cohort.cannot_go_on(study, trials, state)

    def _anew(self, state: SessionState) -> str:
        """Return how a participant begins anew; '' after a later session."""
        opened = state.opened
        assert opened is not None, "it has a plan"
        alike = (
            each.session
            for each in self.summaries
            if (each.participant, each.kind) == (opened.participant, opened.kind)
        )
        if max(alike) > opened.session:
            return ""
        who = ("--participant", opened.participant, "--session", str(opened.session + 1))
        return f"; begin anew: {self._command('run', *who, '--extra', *_options(state))}"

    def _advice(self, chain: str, state: SessionState) -> str:
        named = parsed_name(chain)
        if named.plain in self.running:
            return ""
        if why := self._cannot_go_on(state):
            return f"; {why}{self._anew(state)}"
        if (until := self.resume_before(state)) is None:
            return ""
        who = ["--participant", named.participant]
        who += ["--session", str(named.number)] if named.number != 1 else []
        if until < self.now:
            mark = ["--rehearsal"] if state.opened and state.opened.kind == REHEARSAL else []
            command = self._command("exclude", *who, *mark, "--reason", "not resumed in time")
            return f"; too old to be resumed: {command}"
        again = ("slide", *who[2:]) if named.participant == SLIDE else ("run", *who)
        command = self._command(*again, *_options(state))
        return f"; go on before {until.astimezone():%A %H:%M} with: {command}"

    def next_due(self, summary: cohort.SessionSummary, state: SessionState) -> cohort.Due | None:
        """Return when the session after this one is due; None at any time, or if none is left."""
        if self.study is None or not self._is_latest(summary) or self._is_done(summary.participant):
            return None
        return cohort.due_between(self.study, state)

    def _next_session(self, summary: cohort.SessionSummary, state: SessionState) -> str:
        """Return after a participant's latest session how to begin the next one, if one lacks."""
        who = summary.participant
        if self._is_imported:
            return ""
        if summary.state != "completed" or not self._is_latest(summary) or self._is_done(who):
            return ""
        done, number = self._completed(who), 1 + max(each.session for each in self._had[who])
        extra = ["--extra"] if number > self._each else []
        options = ("--participant", who, "--session", str(number), *extra, *_options(state))
        due = self.next_due(summary, state)
        when = f" {cohort.due_in_words(due)}" if due else ""
        return f"; {done} of {self._each} sessions, next{when}: {self._command('run', *options)}"

    def _cohort(self) -> str:
        of = "" if self.planned is None else f" of {self.planned}"
        s = "" if (self.planned or self.done) == 1 else "s"
        done = f"Done: {self.done}{of} participant{s}."
        groups = self.groups
        counted = [f"{it['name']} {it['done']} of {it['planned']}" for it in groups]
        done += f" Groups: {'; '.join(counted)}." * bool(counted)
        missing = {it["name"]: it["planned"] - it["done"] for it in groups}
        # A group that is too large leaves another one too small.
        enough = self.planned is not None and self.done >= self.planned
        if self._is_imported or (enough and max(missing.values(), default=0) <= 0):
            return f"{done} Next: {self._command('report')}"
        if self.unusable:
            return f"{done} No session can begin or go on: {self.unusable}"
        told = self.study is not None and self.study.design.assign_groups == "by the operator"
        group = ["--group", max(missing, key=missing.__getitem__)] if missing and told else []
        command = self._command("run", "--participant", self.next_participant, *group)
        if missing:
            return f"{done} The next participant, for example: {command}"
        return (
            f"{done} The next participant gets slot {self.next_slot} of the design, "
            f"for example: {command}"
        )

    @property
    def _is_imported(self) -> bool:
        """Whether the study describes imported scores, which no session follows."""
        return self.study is not None and self.study.imported

    def _command(self, name: str, *options: str) -> str:
        return f"{self.program} {' '.join(map(typed_as, [name, self.folder, *options]))}"


def _options(state: SessionState) -> list[str]:
    """Return the options with which a session ran, as far as the journal has them."""
    opened = state.opened
    if not isinstance(opened, SessionOpened):
        return []
    if opened.participant == SLIDE:
        return ["--rehearsal"] if opened.kind == REHEARSAL else []
    virtual = ["--ratings", "virtual"] if opened.virtual else []
    console = ["--ratings", "console"] if state.windowless and not opened.virtual else []
    rehearsal = ["--rehearsal"] if opened.kind == REHEARSAL and not opened.virtual else []
    language = ["--language", opened.language] if opened.language not in {None, "en"} else []
    consent = ["--consent", opened.consent] if opened.consent else []
    return [*virtual, *console, *rehearsal, *[str(word) for word in language], *consent]


def _next_pseudonym(participants: Iterable[str]) -> str:
    """Return the pseudonym after those of `participants`, P01 if there are none.

    >>> _next_pseudonym(["P09", "P02"])
    'P10'
    """
    counted = [numbered for name in participants if (numbered := re.fullmatch(r"(.*?)(\d+)", name))]
    if not counted:
        return "P01"
    # The largest number and not the latest session, because people may come in any order.
    last = max(counted, key=lambda numbered: int(numbered[2]))
    return f"{last[1]}{int(last[2]) + 1:0{len(last[2])}d}"
