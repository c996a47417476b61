"""Import of a data set that touchbeam exported, as a study with the same sessions."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from protocol.errors import BadInput
from protocol.journal.events import StoredEvent, StudyRegistered
from protocol.journal.shared_form import (
    FOLDER,
    MOST_BYTES,
    REGISTRATION_FILE,
    STUDY_FILE,
    SUFFIX,
    SharedSession,
    shared_session,
)
from protocol.registration.registration import shared_registration
from protocol.study_file.loading import parsed_study
from protocol.study_file.toml import LONGEST_TEXT
from runner.journal.names import REHEARSAL, STUDY_CHAIN, session_name
from runner.journal.opening import open_journal
from runner.study.files import bytes_of, text_of
from runner.study.folder import DIALECTS, StudyFolder, new_study


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """The text of a study and its sessions by the names of their chains, oldest first.

    `registration` is the event of its registration, None without one.
    """

    study_text: str
    sessions: Mapping[str, SharedSession]
    registration: StoredEvent | None = None


def read_data_set(source: Path) -> DataSet:
    """Return the study in the folder `source`, which is a BIDS or an RO-Crate data set.

    Raises:
        BadInput: touchbeam has not exported it, or a file was changed so that it cannot be read.
    """
    place = source / FOLDER
    study_file = place / STUDY_FILE
    if not study_file.exists():
        raise BadInput(
            f"{source}: must be what touchbeam export --format bids or rocrate wrote; "
            f"{FOLDER}/{STUDY_FILE} is missing"
        )
    text = text_of(bytes_of(study_file, most=LONGEST_TEXT), study_file)
    parsed_study(text, str(study_file), dialects=DIALECTS)
    files = sorted(place.glob(f"*{SUFFIX}"))
    texts = ((str(file), text_of(bytes_of(file, most=MOST_BYTES), file)) for file in files)
    sessions = {_name(session): session for session in shared_sessions(texts)}
    if len(sessions) != len(files):
        raise BadInput(f"{place}: must hold each session once")
    return DataSet(study_text=text, sessions=sessions, registration=_registration(place))


def _registration(place: Path) -> StoredEvent | None:
    file = place / REGISTRATION_FILE
    if not file.exists():
        return None
    text = bytes_of(file, most=LONGEST_TEXT).decode(errors="replace")
    return shared_registration(text, str(file))


def shared_sessions(texts: Iterable[tuple[str, str]]) -> list[SharedSession]:
    """Return the sessions in `texts`, each after its file's name, in the order of the study.

    Raises:
        BadInput: one of the texts is no session.
    """
    found = (shared_session(name, text) for name, text in texts)
    return sorted(found, key=lambda session: session.place)


def import_data_set(folder: StudyFolder, data: DataSet) -> None:
    """Create a study with the same sessions."""
    with (
        new_study(folder, data.study_text),
        open_journal(folder.journal) as journal,
        journal.alone(),
    ):
        if data.registration is not None:
            registered = data.registration.record
            assert isinstance(registered, StudyRegistered)
            (folder.path / REGISTRATION_FILE).write_bytes(registered.text.encode())
            journal.append(STUDY_CHAIN, data.registration)
        for name, session in data.sessions.items():
            for event in session.events:
                journal.append(name, event)


def _name(session: SharedSession) -> str:
    plain = session_name(session.opened.participant, session.opened.session)
    return f"{plain} ({REHEARSAL})" if session.opened.kind == REHEARSAL else plain
