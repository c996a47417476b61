"""Import of scores as a study with one completed session of each subject, or several."""

from collections.abc import Iterable

from protocol.journal.events import ScoresImported
from runner.clock import WallClock
from runner.journal.names import session_name
from runner.journal.opening import open_journal
from runner.journal.store import SessionLog
from runner.study.folder import StudyFolder, named_after, new_study


def import_scores(
    folder: StudyFolder, text: str, name: str, sessions: Iterable[ScoresImported]
) -> None:
    """Create a study from the text of its file, called `name`, with a session for each event."""
    called = named_after(name, text)
    with new_study(folder, called), open_journal(folder.journal) as journal, journal.alone():
        for imported in sessions:
            chain = session_name(imported.participant, imported.session)
            SessionLog(journal, chain, WallClock()).append(imported)
