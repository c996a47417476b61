"""Published scores become a study: one completed session per subject."""

import json
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

from protocol.errors import BadInput
from protocol.journal.events import ScoresImported
from protocol.study.fields import LONGEST_NAME, printable
from protocol.study_file.loading import template
from runner.clock import WallClock
from runner.journal.session_log import SessionLog
from runner.journal.store import open_journal, session_name
from runner.study.folder import StudyFolder, new_study


def bytes_of(path: Path) -> bytes:
    """Return what stands in the file `path`.

    Raises:
        BadInput: there is none that can be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise BadInput(f"{path}: no such file") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror})") from error


def text_of(content: bytes, path: Path) -> str:
    """Return `content` of the file `path` as text, without a byte order mark.

    Raises:
        BadInput: it is not UTF-8.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadInput(f"{path}: cannot be read as UTF-8 text ({error})") from error


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
