"""What a session is asked to be: its options, checked against the study and this machine.

What is more often a slip than meant is confirmed by the operator.
"""

import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from typing import TypeVar

from device.people.person import Population
from device.resonance import Resonance
from protocol.address import SIMULATED
from protocol.errors import BadInput, listed
from protocol.journal.state import UNFINISHED
from protocol.plan.plan import slide_study
from protocol.pseudonyms import pseudonym
from protocol.registration.registration import Registration, locked
from protocol.study.participant_texts import Wording, lacking, study_codes, study_wording
from protocol.study.study import Study
from protocol.study.study_question import BETWEEN, Answer, StudyQuestion
from protocol.study_file.limits import slide_problems
from protocol.study_file.loading import StudyError, located
from protocol.study_file.toml import in_toml
from runner.clock import Pace
from runner.journal.cohort import Arrival, due_between, due_in_words, states
from runner.journal.names import chain_name, chains_of, is_rehearsal, parsed_name, session_name
from runner.journal.opening import checked_place, mounts_of_this_machine, read_journal
from runner.journal.store import Journal, JournalError
from runner.people.participant_console import require_typist
from runner.people.terminal import at_terminal, require_foreground, typed_answer
from runner.screens import AnswerSource
from runner.session.session import SessionKind
from runner.session.setup import OPERATOR_QUESTIONS, spoken
from runner.study.check import runnable_study
from runner.study.folder import StudyFolder
from runner.study.registered import registration_of

_T = TypeVar("_T")
Confirm = Callable[[str, str], None]
"""Asks whether a fact is meant; raises `BadInput`, with the option to give, if it is not."""


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """The options of `touchbeam run`; if it `slides`, of `slide`, with the participant `SLIDE`."""

    folder: StudyFolder
    participant: str
    number: int = 1
    device: str | None = None
    ratings: AnswerSource = "window"
    pace: Pace | None = None
    rehearsal: bool = False
    language: str | None = None
    consent: str | None = None
    seed: int | None = None
    calibration: Resonance | None = None
    law: str | None = None
    rung: str | None = None
    damping: float | None = None
    people: Population | None = None
    at_window: bool = False
    screen: int | None = None
    windowed: bool = False
    extra: bool = False
    override: str | None = None
    group: str | None = None
    noted: Mapping[str, str] = field(default_factory=dict)
    """What the operator answered so that the group could follow."""
    new_name: bool = False
    slides: bool = False


@dataclass(frozen=True, kw_only=True)
class Request:
    """The options, checked against the study and this machine."""

    options: SessionOptions
    study: Study
    text: str
    wording: Wording
    url: str
    pace: Pace
    kind: SessionKind
    registration: Registration | None = None

    @property
    def name(self) -> str:
        return session_name(self.options.participant, self.options.number)

    @property
    def rehearsal(self) -> bool:
        return self.kind == "rehearsal"

    def chain(self, journal: Journal) -> str:
        options = self.options
        return chain_name(journal, options.participant, options.number, rehearsal=self.rehearsal)

    @property
    def seed(self) -> int:
        """The seed of all that is simulated; a registration seeds the plan alone."""
        return self.study.study.seed if self.options.seed is None else self.options.seed


def requested(options: SessionOptions) -> Request:
    """Check everything that can be checked before anything is opened or changed."""
    text = options.folder.text()
    source = str(options.folder.study_file)
    study = runnable_study(text, source)
    if options.slides:
        if found := slide_problems(study):  # a study without [slide] was not asked for it
            raise StudyError(source, located(text, found))
        study = slide_study(study)
    url = options.device or study.rig.device
    request = Request(
        options=options,
        study=study,
        text=text,
        wording=_wording(study, options.language or study.session.language),
        url=url,
        pace=_pace(options, study, url),
        kind=_kind(options, study, url),
        registration=registration_of(options.folder.path),
    )
    if not options.slides:
        pseudonym(options.participant)
    checked_place(options.folder.path, mounts_of_this_machine())
    if options.ratings != "virtual":
        require_typist(sys.stdin)
    if request.pace == "wall" and at_terminal(sys.stdin):
        require_foreground(sys.stdin)
    return request


def _pace(options: SessionOptions, study: Study, url: str) -> Pace:
    """Return the pace; raises `BadInput` if options do not go together."""
    simulated = url == SIMULATED
    if not simulated and (options.law or options.rung or options.damping is not None):
        raise BadInput(f"--law, --rung and --damping are for --device sim, got {url}")
    if options.people is not None and options.ratings != "virtual":
        raise BadInput(f"--people is for --ratings virtual, got {options.ratings}")
    if unknown := {*(options.people.groups if options.people else ())}.difference(study.groups):
        told = f"[group.{in_toml(min(unknown))}]"
        names = listed(study.groups) or "none"
        raise BadInput(f"--people: {told} must name a group of the study, which has {names}")
    if options.at_window and options.ratings != "virtual":
        raise BadInput(f"--at-window is for --ratings virtual, got {options.ratings}")
    unattended = simulated and options.ratings == "virtual" and not options.at_window
    if options.pace == "stepped" and not unattended:
        raise BadInput(
            "--pace stepped needs --device sim and --ratings virtual without --at-window (people "
            "and windows go on in real time)"
        )
    return options.pace or ("stepped" if unattended else "wall")


def _kind(options: SessionOptions, study: Study, url: str) -> SessionKind:
    """Return the kind of the session; raises `BadInput` if a required consent is not given."""
    if options.rehearsal or url == SIMULATED or options.ratings == "virtual":
        return "rehearsal"
    if options.slides:
        return "slide"
    if study.session.consent_required and not options.consent:
        raise BadInput("this study requires a consent: give its reference with --consent REF")
    return "participant"


_ONLY_REHEARSED = (
    ("the device is simulated", "give the device with --device"),
    ("--ratings virtual with --consent", "leave out one of the two"),
)
"""Why a session in which a person may be meant is a rehearsal, and the way out."""


def require_meant(request: Request, confirm: Confirm, now: datetime) -> None:
    """Have the operator confirm what may be a slip; refuse a session that is not planned or due."""
    options, planned = request.options, request.study.design.sessions
    if options.slides:  # a name that cannot be mistaken, and as many as anybody wants
        return
    if options.number > planned and not options.extra:
        raise BadInput(
            f"--session {options.number}: the study plans {planned} for each participant; add "
            "--extra for another one"
        )
    if number := _not_completed(request):
        confirm(
            f"{request.name}: session {number} of {options.participant} is not completed",
            "finish or exclude it first; if that is meant, add --extra",
        )
    if not options.override and (when := recorded(request, partial(_not_due, request, now))):
        raise BadInput(
            f"{request.name} {when}; add --override REASON to begin all the same: the journal "
            "keeps the reason"
        )
    person = options.consent is not None or options.ratings != "virtual"
    if person and request.rehearsal and not options.rehearsal:
        why, otherwise = _ONLY_REHEARSED[options.ratings == "virtual"]
        confirm(
            f"{why}: {request.name} will be a rehearsal, which no report counts",
            f"add --rehearsal if that is meant; otherwise {otherwise}",
        )
    if options.new_name:
        return
    alike = partial(nearly_the_same, participant=options.participant, rehearsal=request.rehearsal)
    if other := recorded(request, alike):
        confirm(
            f"{options.participant} resembles {other}, who has a session here, and is taken for "
            "somebody else",
            f"give --participant {other} if that is meant, else add --new",
        )


def with_group(request: Request, say: Callable[[str], None]) -> Request:
    """Return the request with the group that the operator knows; `BadInput` for another one."""
    options, registered = request.options, request.registration
    study = locked(request.study, registered.digest if registered else None)
    if options.slides or not (study.group or options.group):
        return request
    known = recorded(request, lambda journal: (states(journal), request.chain(journal)))
    sessions, chain = known or ({}, "")
    who = Arrival(sessions, options.participant, request.kind, chain)
    asked, noted = options.group, dict(options.noted)
    by_answer = study.design.assign_groups == "by an answer"
    # A rehearsal takes any group that it is given, and a virtual participant one by chance.
    wanted = not asked or (by_answer and not request.rehearsal)
    if wanted and options.ratings != "virtual" and who.known_group is None:
        if by_answer:
            asked, noted = _group_answered(request, say)
        elif study.design.assign_groups == "by the operator":
            names = listed(study.groups)
            text = f"Type the group of {options.participant} ({names}), then Enter."

            def read(typed: str) -> str | None:
                if typed in study.groups:
                    return typed
                say(f"{typed!r} is no group; capitals and small letters differ.")
                return None

            with suppress(EOFError):
                asked = typed_answer(say, text, read)
    if options.group not in {None, asked}:
        raise BadInput(f"the answer leads to the group {asked}, got --group {options.group}")
    who.group(study, asked)  # told before anything is opened
    return replace(request, options=replace(options, group=asked, noted=noted))


def _group_answered(request: Request, say: Callable[[str], None]) -> tuple[str, dict[str, str]]:
    """Ask the operator what groups depend on; return the first group that follows, and answers."""
    study = request.study
    given: dict[str, Answer] = {}
    rules = {group.name: group.when for group in study.group if group.when is not None}
    needed = {rule.question for rule in rules.values()}
    asked: list[tuple[str, str, StudyQuestion]] = [
        (name, *OPERATOR_QUESTIONS[name]) for name in study.session.operator_asks
    ]
    asked += [(each.name, spoken(each), each) for each in study.questions("desk")]
    for name, text, question in asked:
        if name not in needed or not question.follows(given):
            continue

        def read(typed: str, question: StudyQuestion = question, name: str = name) -> str | None:
            try:
                given[name] = question.answer(typed)
            except ValueError as error:
                say(str(error))
                return None
            return typed or None  # without an answer there is no group

        try:
            typed_answer(say, text, read)
        except EOFError:
            raise BadInput(f"{name} decides on the group: run this at a terminal") from None
    found = next((group for group, rule in rules.items() if rule.met_by(given)), None)
    if found is None:
        told = ", ".join(f"{name} {answer}" for name, answer in given.items())
        who = request.options.participant
        those = "; ".join(f"{group} if {rule}" for group, rule in rules.items())
        raise BadInput(f"{told}: no group of the study is for {who} ({those})")
    return found, {
        name: BETWEEN.join(answer) if isinstance(answer, tuple) else str(answer)
        for name, answer in given.items()
    }


def refused(fact: str, option: str) -> None:
    """Refuse what nobody can confirm."""
    raise BadInput(f"{fact}; {option}")


def recorded(request: Request, asked: Callable[[Journal], _T]) -> _T | None:
    """Return what `asked` finds in the journal; None without one, or if it cannot be read."""
    path = request.options.folder.journal
    with suppress(JournalError):  # opening the journal for the session will tell
        if path.exists():
            with read_journal(path) as journal:
                return asked(journal)
    return None


def _not_completed(request: Request) -> int | None:
    """Return which session must come before a new one; those that were excluded are over."""
    options = request.options
    if request.rehearsal or options.extra or options.number == 1:
        return None
    lacking = partial(lacking_before, request)
    return recorded(request, lacking) if options.folder.journal.exists() else 1


def lacking_before(request: Request, journal: Journal) -> int | None:
    """Return the first session of the participant that a new one leaves out; None if none lacks."""
    known, options = states(journal), request.options
    own = chains_of(journal, options.participant, rehearsal=request.rehearsal)
    over = {parsed_name(chain).number for chain in own if known[chain].name not in UNFINISHED}
    lacking = (number for number in range(1, options.number) if number not in over)
    return None if options.slides or request.chain(journal) in known else next(lacking, None)


def _not_due(request: Request, now: datetime, journal: Journal) -> str | None:
    """Say when a session is due that would begin too early or too late."""
    options, chain = request.options, request.chain(journal)
    known = states(journal)
    name = chain_name(journal, options.participant, options.number - 1, rehearsal=False)
    before = known.get(name)
    due = before and due_between(request.study, before)
    if request.rehearsal or chain in known or not due or due[0] <= now <= due[1]:
        return None
    return f"is due {due_in_words(due)}"


def nearly_the_same(journal: Journal, participant: str, *, rehearsal: bool) -> str | None:
    """Return who else has a pseudonym that differs only in capitals, zeros or separators.

    None if there is nobody, among rehearsals or sessions, or `participant` is known already.
    """
    alike = [
        other
        for chain in journal.sessions()
        if _essence(other := parsed_name(chain).participant) == _essence(participant)
        and is_rehearsal(journal, chain) == rehearsal
    ]
    return None if participant in alike else next(iter(alike), None)


def _essence(pseudonym: str) -> str:
    """Return what remains of a pseudonym without what people mistype.

    >>> _essence("P08"), _essence("p-8"), _essence("P80")
    ('p8', 'p8', 'p80')
    """
    return re.sub("(?<![0-9])0+(?=[0-9])", "", re.sub("[_-]", "", pseudonym.casefold()))


def _wording(study: Study, code: str) -> Wording:
    """Return what the participant reads in the language asked for, if nothing of it is lacking."""
    if code not in study_codes(study):
        raise BadInput(
            f"--language must be one of {', '.join(study_codes(study))}, got {code!r}; "
            "touchbeam translate begins the file of another one"
        )
    if text := next(lacking(study, code), None):
        raise BadInput(f"--language {code}: this study lacks {text} in it")
    return study_wording(study, code)
