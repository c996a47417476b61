"""Verification of a journal, and backups: unbroken chains, events in order, each trial once."""

import os
import secrets
from collections.abc import Iterable, Iterator, Sequence, Set
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import Any

from protocol.errors import IMPOSSIBLE, BadInput, WorkFailed, shown
from protocol.journal import events as kinds
from protocol.journal.records import TrackAnswer
from protocol.journal.state import NotAllowed, SessionState, damage, folded, in_words
from protocol.registration.registration import locked, registration_in
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, text_digest
from runner.journal import store
from runner.journal.database import RESTORE
from runner.journal.names import REHEARSAL, STUDY_CHAIN, is_rehearsal, parsed_name, session_name
from runner.journal.opening import read_journal
from runner.journal.plausible import contradiction


@dataclass(frozen=True, kw_only=True)
class SessionVerdict:
    """The result of verifying one session."""

    participant: str
    session: int
    kind: str
    state: str
    events: int
    trials_planned: int
    trials_answered: int
    trials_aborted: int
    duplicates: int
    missing: int
    chain_ok: bool
    versions: tuple[str, ...] = ()
    problem: str = ""

    @property
    def ok(self) -> bool:
        """Whether there is no problem; only a completed session must have all its answers."""
        lacking = self.state == "completed" and self.missing > 0
        return self.chain_ok and not (self.problem or self.duplicates or lacking)

    def line(self, running: Set[str] = frozenset()) -> str:
        """Return one line for people to read; `running` are the sessions that a process runs."""
        chain = "chain unbroken" if self.chain_ok else "CHAIN BROKEN"
        line = f"{'ok  ' if self.ok else 'FAIL'}  {self._summary(running)}, {chain}"
        if len(self.versions) > 1:
            line += f"; written by several versions of touchbeam: {', '.join(self.versions)}"
        line += f"; {self.problem}" * bool(self.problem)
        told = self.chain_ok or RESTORE in self.problem
        return line if told else f"{line}; {RESTORE}"

    def _summary(self, running: Set[str]) -> str:
        count = f"{self.events} event{'s' * (self.events != 1)}"
        if self.participant == STUDY_CHAIN:
            return f"the study itself  {self.state}  {count}"
        rehearsed = f" ({REHEARSAL})" if self.kind == REHEARSAL else ""
        done = "passes drawn" if self.participant == kinds.SLIDE else "trials answered"
        name = session_name(self.participant, self.session)
        state = in_words(self.state, running=name in running)
        if self.kind in {kinds.SCRIPT, kinds.ScoresImported.kind}:
            return f"{name}  {state}  {count}"
        return (
            f"{name}{rehearsed}  {state}  {self.trials_answered} of {self.trials_planned} {done}, "
            f"{self.trials_aborted} aborted, {self.duplicates} answered twice"
        )

    def record(self) -> dict[str, Any]:
        return {"ok": self.ok, **asdict(self)}


def verdicts(journal: store.Journal) -> list[SessionVerdict]:
    try:
        known = journal.records_of(kinds.StudyRegistered)
    except store.JournalError:  # the verdict on the study's own chain tells
        known = []
    return [_verdict(journal, name, known) for name in journal.sessions()]


def _verdict(journal: store.Journal, name: str, known: "Registrations") -> SessionVerdict:
    try:
        verdict = session_verdict(name, list(journal.chain(name)))
    except store.JournalError as error:
        # One damaged session must not hide the verdicts on the others.
        verdict = session_verdict(name, [])
        return replace(verdict, state="unreadable", problem=str(error))
    if verdict.problem:
        return verdict
    try:
        return replace(verdict, problem=session_problem(journal, name, known))
    except IMPOSSIBLE:
        return replace(verdict, problem=damage(journal.events(name)))


def session_verdict(name: str, chain: list[store.ChainLink]) -> SessionVerdict:
    named = parsed_name(name)
    state, planned, problem = _folded(name, [link.event for link in chain])
    erased = state.name == "withdrawn"
    if erased and not all(link.event.erased and not link.salt for link in chain):
        problem = "withdrawn but not erased; run touchbeam withdraw again"
    return SessionVerdict(
        participant=named.participant,
        session=named.number,
        kind=named.kind or ("unknown" if state.opened is None else state.opened.kind),
        state=state.shown_name,
        events=len(chain),
        trials_planned=len(planned),
        trials_answered=len(state.answered),
        trials_aborted=len(state.aborted),
        duplicates=len(state.answered_twice),
        missing=len(planned - state.answered),
        chain_ok=chain_is_unbroken(name, chain, erased=erased),
        versions=touchbeam_versions(link.event for link in chain),
        problem=problem,
    )


def touchbeam_versions(events: Iterable[kinds.StoredEvent]) -> tuple[str, ...]:
    """Return the versions of touchbeam that have opened and resumed a session, in order."""
    return tuple(version for version, _ in groupby(filter(None, map(_touchbeam_version, events))))


def _touchbeam_version(event: kinds.StoredEvent) -> str:
    """Return the version of touchbeam in `event`; '' if it has none or is damaged."""
    with suppress(*IMPOSSIBLE):
        terms = next(kinds.terms_in([event]), None)
        version = terms and terms.versions.get("touchbeam")
        # It is printed on a terminal, and an edited journal may hold anything.
        return version if isinstance(version, str) and version.isprintable() else ""
    return ""


def readable_events(journal: store.Journal, session: str) -> list[kinds.StoredEvent]:
    """Return the events of `session`, undamaged and with all payloads unless it was withdrawn."""
    events = journal.events(session)
    _require_readable(session, events)
    return events


def readable_chains(
    journal: store.Journal,
    broken: list[str],
    participant: str | None = None,
    *,
    rehearsals: bool = False,
) -> Iterator[list[kinds.StoredEvent]]:
    """Yield the events of each chain, or of one person's; add the names of broken ones to `broken`.

    Withdrawn rehearsals are yielded only if `rehearsals` are asked for. Raise `JournalError` if a
    session is damaged.
    """
    for name in journal.sessions():
        if participant not in {None, name.rpartition("/")[0]}:
            continue
        chain = list(journal.chain(name))
        events = [link.event for link in chain]
        _require_readable(name, events)
        withdrawn = _is_withdrawn(events)
        if not chain_is_unbroken(name, chain, erased=withdrawn):
            broken.append(name)
        # What is erased cannot tell that it was a rehearsal, which no report would have counted.
        if rehearsals or not (withdrawn and parsed_name(name).kind == REHEARSAL):
            yield events


def _is_withdrawn(events: Iterable[kinds.StoredEvent]) -> bool:
    return any(event.tag == kinds.Withdrawn.TAG for event in events)


def _require_readable(session: str, events: list[kinds.StoredEvent]) -> None:
    withdrawn = _is_withdrawn(events)
    if any(event.erased for event in events) and not withdrawn:
        raise store.damaged(session, "it has lost payloads")
    begins = any(
        event.tag == kinds.ScoresImported.TAG
        or (
            event.tag == kinds.SessionOpened.TAG
            and event.payload.keys() >= kinds.SessionOpened.REQUIRED
        )
        for event in events[:1]
    )
    if not (withdrawn or session == STUDY_CHAIN or begins):
        raise store.damaged(session, "it has no opening event")
    state = store.state_of(session, events)
    if wrong := _forged(session, state, events):
        raise store.damaged(session, wrong)


def _forged(session: str, state: SessionState, events: Sequence[kinds.StoredEvent]) -> str:
    """Return what touchbeam cannot have written in events that lead to `state`, or ''.

    Hashes do not tell: who writes a chain can compute them.
    """
    if wrong := next(filter(None, (event.damage() for event in events)), ""):
        return wrong
    if wrong := contradiction(events):
        return wrong
    named, opened = parsed_name(session), state.opened
    if opened is None:
        return ""
    told = session_name(opened.participant, opened.session)
    nobody = opened.participant in kinds.NOBODY
    own = {opened.participant} if nobody else {"participant", kinds.ScoresImported.kind}
    # In journals of earlier versions a rehearsal has a plain name.
    allowed = {named.kind} if named.kind else {*own, REHEARSAL}
    if told != named.plain or opened.kind not in allowed:
        return f"event 0 is damaged: it opens another session, {shown(f'{told} ({opened.kind})')}"
    return ""


def chain_is_unbroken(name: str, chain: Iterable[store.ChainLink], *, erased: bool) -> bool:
    """Return whether each hash and payload follows; an `erased` chain may lack its payloads."""
    previous = store.FIRST_HASH
    chain = list(chain)
    for seq, link in enumerate(chain):
        fields = store.event_fields(name, link.event, link.payload_sha256)
        if link.event.seq != seq or store.chain_hash(previous, fields) != link.hash:
            return False
        if link.payload is None:
            intact = erased
        else:
            digest = link.salt is not None and store.payload_digest(link.payload, link.salt)
            intact = digest == link.payload_sha256
        if not intact:
            return False
        previous = link.hash
    # A chain without events proves nothing.
    return bool(chain)


def _folded(name: str, events: list[kinds.StoredEvent]) -> tuple[SessionState, set[int], str]:
    """Return the state and the planned trials of a session, and what is wrong with it, or ''."""
    try:
        return (state := folded(events)), state.planned, _forged(name, state, events)
    except (NotAllowed, *IMPOSSIBLE) as error:
        why = str(error) if isinstance(error, NotAllowed) else damage(events)
        return SessionState(name="impossible"), set(), why


# The registrations in a journal, and the check that its sessions ran under them.

Registrations = list[tuple[datetime, kinds.StudyRegistered]]
"""Each with its UTC, the one in force last."""


def in_force(journal: store.Journal) -> kinds.StudyRegistered | None:
    """Return the registration that sessions follow now, None if the study is not registered."""
    # The latest one replaces those before it, which the journal keeps.
    made = journal.records_of(kinds.StudyRegistered)
    return made[-1][1] if made else None


def session_problem(journal: store.Journal, chain: str, known: Registrations) -> str:
    """Return why a readable session did not run under the `known` registrations, or ''."""
    events = journal.events(chain)
    if chain == STUDY_CHAIN:
        return _registered_problem(known)
    opened = events[0].record if events and not events[0].erased else None
    # Imported scores have no plan, and a withdrawn session tells none.
    if not isinstance(opened, kinds.SessionOpened):
        return ""
    before = any(utc <= events[0].utc for utc, _ in known) and opened.kind != kinds.SCRIPT
    # A session that was opened before the registration cannot name it.
    if before and opened.registration is None and not is_rehearsal(journal, chain):
        return "it is not registered, although the study was registered before it"
    held = {None, *(record.registration for _, record in known)}
    for under in kinds.terms_in(events):
        # A journal that an earlier version made of exported data may have sessions alone.
        if known and under.registration not in held:
            return "its registration is none that the journal holds"
        # Otherwise another study file could be put beside the registration.
        if (
            under.registration is not None
            and under.study_text is not None
            and under.study_sha256 != text_digest(under.study_text)
        ):
            return "its study file does not have the digest that the journal names"
    return _level_problem(opened, events)


def _level_problem(opened: kinds.SessionOpened, events: Iterable[kinds.StoredEvent]) -> str:
    """Return which answer was given at a level that does not follow from those before, or ''."""
    before: dict[str, list[TrackAnswer]] = {}
    under: kinds.SessionTerms | None = None
    for event in events:
        if event.tag in {kinds.SessionOpened.TAG, kinds.SessionResumed.TAG}:
            (under,) = kinds.terms_in([event])
        # Only tracks ask for numpy, and for the study as it was.
        if under is None or under.study_text is None or event.tag != kinds.Answered.TAG:
            continue
        made = event.record if any(it.track for it in under.trials) else None
        if not isinstance(made, kinds.Answered) or made.track is None or opened.slot is None:
            continue
        from device.tracks.next_level import recorded_level

        try:
            study = _as_run(under.study_text, under.registration, opened.group)
        except BadInput as error:  # this version refuses it
            return f"the levels of its tracks cannot be followed ({error})"
        told = before.setdefault(made.track.name, [])
        level = recorded_level(study, made.track, told, opened.slot, opened.session)
        value = None if level is None else study.track_of(made.track.name).values[level]
        if (made.track.level, made.track.value) != (level, value):
            return (
                f"trial {made.index} of the track {made.track.name!r} was made at level "
                f"{made.track.level} ({made.track.value}); the answers before it lead to level "
                f"{level}"
            )
        told.append(made.track)
    return ""


@lru_cache(maxsize=64)
def _as_run(study_text: str, digest: str | None, group: str | None) -> Study:
    """Return the study of a session: locked by its registration, if it has one, and of its group.

    Raise `BadInput` for a text that this version refuses.
    """
    return locked(parsed_study(study_text), digest).of_group(group)


def _registered_problem(known: Registrations) -> str:
    for _, record in known:
        try:
            made = registration_in(record.text, "a registration in the journal")
        except BadInput as error:
            return str(error)
        if (made.digest, made.study_sha256) != (record.registration, record.study_sha256):
            return "a registration in the journal does not have its digest"
    return ""


def backed_up(path: Path, file: Path) -> tuple[tuple[str, ...], list[SessionVerdict]]:
    """Copy the journal at `path`, as it is now, into the new file `file`, whole or not at all.

    It is on the disk when this returns the triggers that it lacks and a verdict on each chain.
    Raise `BadInput` if `file` exists, `JournalError` for the journal, and `OSError`, which names
    `file`.
    """
    _require_new(file)
    with read_journal(path, to_verify=True) as journal:
        withdrawals = journal.withdrawals()
    # On the same disk, so that it can be renamed, and under a name that nobody takes for a backup.
    beside = file.with_name(f".touchbeam-{secrets.token_hex(8)}")
    try:
        # SQLite would make a file that others may read, as the umask has it.
        os.close(os.open(beside, os.O_CREAT | os.O_EXCL, 0o600))
        with read_journal(path, to_verify=True) as journal:
            journal.copy_to(beside)
        with read_journal(beside, to_verify=True) as copy:
            # Read back from the file, because a backup that was never read is a hope.
            result = copy.lacking_triggers, verdicts(copy)
        with beside.open("rb+") as written:
            # Before it gets its name, which must not lead to half a file after a power cut.
            os.fsync(written.fileno())
        _take_name(beside, file)
        try:
            require_no_withdrawal(path, withdrawals)
        except BaseException:
            file.unlink()
            raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from error
    finally:
        # What SQLite may have left beside the copy; once renamed, nothing has that name.
        for ending in ("", "-journal", "-wal", "-shm"):
            beside.with_name(f"{beside.name}{ending}").unlink(missing_ok=True)
    return result


def require_no_withdrawal(path: Path, before: int) -> None:
    """Raise `WorkFailed` unless the journal has as many withdrawals as before it was read.

    Who writes a person's data asks once they are written, and then takes them away. So either this
    sees the withdrawal, or the withdrawal came later and can name what was written.
    """
    with read_journal(path, to_verify=True) as journal:
        if journal.withdrawals() != before:
            raise WorkFailed("somebody withdrew meanwhile, so nothing is written; make it again")


def _require_new(file: Path) -> None:
    if file.exists() or file.is_symlink():
        raise BadInput(f"{file}: exists and is not overwritten; choose another name")


def _take_name(written: Path, file: Path) -> None:
    """Name `written` also `file`, which must not exist, and put the new name on the disk."""
    try:
        file.hardlink_to(written)  # a renaming would replace a file that was made meanwhile
    except FileExistsError:
        _require_new(file)
    except OSError:  # a memory stick has no links: there a kill at this moment leaves an empty file
        os.close(os.open(file, os.O_CREAT | os.O_EXCL, 0o600))
        written.replace(file)
    # Windows cannot open folders.
    if hasattr(os, "O_DIRECTORY"):
        folder = os.open(file.parent, os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
