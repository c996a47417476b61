"""Import of a data set that touchbeam exported, as a study with the same sessions."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from protocol.errors import BadInput
from protocol.journal import events, shared_form
from protocol.journal.records import PlannedTrial
from protocol.registration.registration import shared_registration
from protocol.study.rules import Rating
from protocol.study.study_question import ANSWERS, INTERVALS
from protocol.study_file.loading import parsed_study, template, text_digest
from protocol.study_file.toml import LONGEST_TEXT
from runner.clock import WallClock
from runner.journal.names import REHEARSAL, STUDY_CHAIN, session_name
from runner.journal.opening import open_journal
from runner.journal.store import SessionLog
from runner.study.files import bytes_of, text_of, write_whole
from runner.study.folder import DIALECTS, StudyFolder, named_after, new_study


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """A study's text, its sessions by chain, oldest first, and the event of its registration."""

    study_text: str
    sessions: Mapping[str, shared_form.SharedSession]
    registration: events.StoredEvent | None = None


def read_data_set(source: Path) -> DataSet:
    """Return the study in the BIDS data set `source`; `BadInput` if it is damaged."""
    place = source / shared_form.FOLDER
    study_file = place / shared_form.STUDY_FILE
    if not study_file.exists():
        raise BadInput(
            f"{source}: must be what touchbeam export --format bids wrote; "
            f"{shared_form.FOLDER}/{shared_form.STUDY_FILE} is missing"
        )
    text = text_of(bytes_of(study_file, most=LONGEST_TEXT), study_file)
    rating = parsed_study(text, str(study_file), dialects=DIALECTS).rating
    files = sorted(place.glob(f"*{shared_form.SUFFIX}"))
    texts = (
        (str(file), text_of(bytes_of(file, most=shared_form.MOST_BYTES), file)) for file in files
    )
    named = [(name, shared_form.shared_session(name, content)) for name, content in texts]
    for name, session in named:
        _require_possible(name, session, {text_digest(text): rating})
    sessions = {}
    for session in _in_order(it for _, it in named):
        rehearsed = f" ({REHEARSAL})" * (session.opened.kind == REHEARSAL)
        name = session_name(session.opened.participant, session.opened.session)
        sessions[f"{name}{rehearsed}"] = session
    # Two files of one session would be one chain, in which events come twice.
    if len(sessions) != len(files):
        raise BadInput(f"{place}: must hold each session once")
    return DataSet(study_text=text, sessions=sessions, registration=_registration(place))


def _registration(place: Path) -> events.StoredEvent | None:
    file = place / shared_form.REGISTRATION_FILE
    if not file.exists():
        return None
    # As it is: text without its byte order mark would have another digest.
    text = bytes_of(file, most=LONGEST_TEXT).decode(errors="replace")
    return shared_registration(text, str(file))


def _in_order(sessions: Iterable[shared_form.SharedSession]) -> list[shared_form.SharedSession]:
    return sorted(sessions, key=lambda session: session.place)


def _require_possible(
    source: str, session: shared_form.SharedSession, known: Mapping[str, Rating]
) -> None:
    """Refuse answers that nobody can have given to what a session asked.

    `known` is the rating of the study file by its digest; a session before an amendment was rated
    as its own study file says.
    """
    ratings, trials = dict(known), dict[int, PlannedTrial]()
    for line, stored in enumerate(session.events, start=2):  # the first one has the place
        event = stored.record
        if isinstance(event, events.SessionTerms):
            trials.update({trial.index: trial for trial in event.trials})
            own = event.study_text
            # Each text is parsed once, because every session holds it.
            if own and (digest := text_digest(own)) not in ratings:
                where = f"{source}: line {line}, study_text"
                ratings[digest] = parsed_study(own, where, dialects=DIALECTS).rating
        for wrong in _impossible(event, trials, ratings.values()):
            raise BadInput(f"{source}: line {line}, {event.TAG}, {wrong}")


def _impossible(
    event: events.Event, trials: Mapping[int, PlannedTrial], ratings: Iterable[Rating]
) -> Iterator[str]:
    """Yield which values of an event nobody can have given, and what they must be."""
    for time_s in _reaction_times_s(event):
        if time_s < 0:
            yield f"reaction_time_s: must be at least 0, got {time_s:g}"
    if not isinstance(event, events.Answered):
        return
    if (trial := trials.get(event.index)) is None:
        yield f"index: must be a trial of the session's plan, got {event.index}"
        return
    scales = [range(rating.minimum, rating.maximum + 1) for rating in ratings]
    if event.score is not None and not any(event.score in scale for scale in scales):
        scale = scales[-1]
        yield f"score: must be from {scale[0]} to {scale[-1]}, got {event.score}"
    if event.change is not None:
        yield from _impossible_change(event.change, trial, agrees=event.agrees)


def _impossible_change(change: str, trial: PlannedTrial, *, agrees: bool | None) -> Iterator[str]:
    possible = next((them for asked, them in ANSWERS.items() if asked == trial.question), ())
    if trial.track is not None:
        possible = INTERVALS[: len(trial.touches)] if len(trial.touches) > 1 else ("yes", "no")
        if trial.expected is None and agrees is None:
            agrees = False  # in a catch trial no answer is right
    if change not in possible:
        told = ", ".join(possible) or "null, as nothing was asked"
        yield f"change: must be one of {told}, got {change[:80]!r}"
    if agrees is not (change == trial.expected):
        yield f"agrees: must say whether {change!r} is the expected {trial.expected!r}"


def _reaction_times_s(event: events.Event) -> tuple[float, ...]:
    match event:
        case events.Answered():
            asked = tuple(given.reaction_time_s for given in event.questions)
            return event.reaction_time_s + asked
        case events.QuestionAnswered(reaction_time_s=time_s):
            return (time_s,)
        case events.TouchStarted(instruction=given) if given:
            return (given.reaction_time_s,)
    return ()


def import_data_set(folder: StudyFolder, data: DataSet) -> None:
    with (
        new_study(folder, data.study_text),
        open_journal(folder.journal) as journal,
        journal.alone(),
    ):
        if data.registration is not None:
            registered = data.registration.record
            assert isinstance(registered, events.StudyRegistered)
            # As bytes, because other line ends would change its digest.
            write_whole(folder.path / shared_form.REGISTRATION_FILE, registered.text.encode())
            journal.append(STUDY_CHAIN, data.registration)
        for name, session in data.sessions.items():
            for event in session.events:
                journal.append(name, event)


# Import of published scores as a study with one completed session per subject.


def import_table(
    folder: StudyFolder,
    scores: Iterable[tuple[str, Mapping[str, float | None]]],
    source: str,
    content: bytes,
) -> None:
    """Create a study from `scores`, condition → score or None, one session per subject.

    `source` is the name of their file, after which the study is called, and `content` its bytes.
    """
    digest = sha256(content).hexdigest()
    with (
        new_study(folder, named_after(Path(source).stem, template("paper"))),
        open_journal(folder.journal) as journal,
        journal.alone(),
    ):
        for subject, given in scores:
            imported = events.ScoresImported(
                participant=subject,
                session=1,
                conditions=tuple(given),
                scores=given,
                source=source,
                source_sha256=digest,
            )
            SessionLog(journal, session_name(subject, 1), WallClock()).append(imported)
