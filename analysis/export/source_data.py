"""What a data set was made from: study file, registration, and sessions' events as they may leave.

`touchbeam import` makes a study of these files again; docs/data.md lists what they do not hold.
"""

from collections.abc import Iterable

from analysis.export.dataset import Chain, Dataset
from protocol.journal.events import ScoresImported, SessionOpened, StudyRegistered, Withdrawn
from protocol.journal.shared_form import (
    FOLDER,
    REGISTRATION_FILE,
    STUDY_FILE,
    SUFFIX,
    shared_text,
)


def source_files(data: Dataset, chains: Iterable[Chain], study_text: str) -> dict[str, str]:
    """Return the files by path: of the sessions of `data`, whose events are among `chains`.

    Args:
        data: what is exported.
        chains: the events of all sessions, in their order.
        study_text: the study file with its own languages.
    """
    keys = ["participant", "session", "session_kind"]
    subjects = data.sessions.set_index(keys)["subject"].to_dict()
    files = {f"{FOLDER}/{STUDY_FILE}": study_text}
    for place, events in enumerate(chains):
        first = events[0]
        found = [event.record for event in events if event.tag == StudyRegistered.TAG]
        registered = [record.text for record in found if isinstance(record, StudyRegistered)]
        files |= {f"{FOLDER}/{REGISTRATION_FILE}": text for text in registered}
        withdrawn = any(event.tag == Withdrawn.TAG for event in events)
        opened = None if withdrawn else first.record
        if not isinstance(opened, SessionOpened | ScoresImported):
            continue
        subject = subjects.get((opened.participant, opened.session, opened.kind))
        if subject is not None:
            name = "_".join(data.entities(subject, opened.session))
            files[f"{FOLDER}/{name}{SUFFIX}"] = shared_text(place, events)
    return files
