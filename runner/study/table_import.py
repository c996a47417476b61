"""Import of published scores as a study with one completed session per subject."""

from collections.abc import Iterable, Mapping
from hashlib import sha256
from pathlib import Path

from protocol.journal import events
from protocol.study_file.loading import template
from runner.clock import WallClock
from runner.journal.names import session_name
from runner.journal.opening import open_journal
from runner.journal.store import SessionLog
from runner.study.folder import StudyFolder, named_after, new_study


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
