"""Published scores become a study: one completed session per subject."""

import json
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

from protocol.journal.events import ScoresImported
from protocol.study.fields import LONGEST_NAME, printable
from protocol.study_file.loading import template
from runner.clock import WallClock
from runner.journal.session_log import SessionLog
from runner.journal.store import open_journal, session_name
from runner.study.folder import StudyFolder, new_study


def import_table(
    folder: StudyFolder,
    scores: Mapping[str, Mapping[str, float | None]],
    source: str,
    content: bytes,
) -> None:
    """Write a new study that holds `scores`, subject by subject.

    Args:
        folder: where to make it.
        scores: condition → score, None for a missing one, by subject.
        source: the name of the file they come from; the study is named after it.
        content: what stood in it, for its digest.
    """
    clock = WallClock()
    digest = sha256(content).hexdigest()
    with (
        new_study(folder, _named(template("paper"), source)),
        open_journal(folder.journal) as journal,
        journal.alone(),
    ):
        for subject, given in scores.items():
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


def _named(study_text: str, source: str) -> str:
    """The paper's study under the name of the file that its scores come from."""
    stem = Path(source).stem.encode(errors="replace").decode()
    name = printable(stem)[:LONGEST_NAME]
    # A string of JSON is one of TOML.
    return study_text.replace('name = "paper"', f"name = {json.dumps(name, ensure_ascii=False)}", 1)
