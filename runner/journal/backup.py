"""Backups of a journal: whole, verified copies, made even while a session writes to it."""

import os
import secrets
from pathlib import Path

from protocol.errors import BadInput
from runner.journal.opening import read_journal
from runner.journal.verification import SessionVerdict, verdicts


def backed_up(path: Path, file: Path) -> tuple[tuple[str, ...], list[SessionVerdict]]:
    """Copy the journal at `path`, as it is now, into the new file `file`, whole or not at all.

    It is on the disk when this returns the triggers that it lacks and a verdict on each chain.
    Raise `BadInput` if `file` exists, `JournalError` for the journal, and `OSError`, which names
    `file`.
    """
    _require_new(file)
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
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from error
    finally:
        # What SQLite may have left beside the copy; once renamed, nothing has that name.
        for ending in ("", "-journal", "-wal", "-shm"):
            beside.with_name(f"{beside.name}{ending}").unlink(missing_ok=True)
    return result


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
