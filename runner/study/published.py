"""Import of published scores as a study with one completed session per subject."""

from collections.abc import Iterable, Mapping
from hashlib import sha256
from pathlib import Path

from protocol.journal.events import ScoresImported
from protocol.study_file.loading import template
from runner.clock import WallClock
from runner.journal.names import session_name
from runner.journal.opening import open_journal
from runner.journal.session_log import SessionLog
from runner.study.folder import StudyFolder, named_after, new_study


def import_table(
    folder: StudyFolder,
    scores: Iterable[tuple[str, Mapping[str, float | None]]],
    source: str,
    content: bytes,
) -> None:
    """Create a study from `scores`, one session per subject.

    Args:
        folder: the new study.
        scores: each subject with condition → score, None for a missing one.
        source: name of the file with the scores; also gives the study its name.
        content: the bytes of that file, for its digest.
    """
    clock = WallClock()
    digest = sha256(content).hexdigest()
    with (
        new_study(folder, named_after(Path(source).stem, template("paper"))),
        open_journal(folder.journal) as journal,
        journal.alone(),
    ):
        for subject, given in scores:
            log = SessionLog(journal, session_name(subject, 1), clock)
            log.append(
                ScoresImported(
                    participant=subject,
                    session=1,
                    conditions=tuple(given),
                    scores=given,
                    source=source,
                    source_sha256=digest,
                )
            )
