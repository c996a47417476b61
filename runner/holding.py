"""One session per rig at a time: who holds a rig, and what a second one is told."""

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from protocol.errors import WorkFailed


class RigHeld(WorkFailed):
    """Another session has the rig."""


@contextmanager
def held(what: str, holder: str, *, known_as: str | None = None) -> Iterator[None]:
    """Hold `what`, a rig's address or a session of a study, while the body runs.

    The lock ends with the process, however it ends.

    Args:
        what: the thing of which there is one.
        holder: what somebody else is told, such as the session's name and the study's folder.
        known_as: what tells it from others, if that is not its name.

    Raises:
        RigHeld: another process has it; the message says which session.
    """
    folder = _folder()
    name = hashlib.sha256((known_as or what).encode()).hexdigest()[:24]
    lock, said = FileLock(folder / f"{name}.lock"), folder / f"{name}.json"
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise RigHeld(f"{what} is held by {_holder(said)}; end that session first") from None
    try:
        said.write_text(json.dumps({"holder": holder, "process": os.getpid()}), encoding="utf-8")
        yield
    finally:
        said.unlink(missing_ok=True)
        lock.release()


@contextmanager
def session_held(session: str, study: Path, holder: str) -> Iterator[None]:
    """Hold a session of the study in the folder `study`, by whatever path one comes to it.

    Raises:
        RigHeld: another process has it.
    """
    place = study.stat()
    known_as = f"session {session} of {place.st_dev}:{place.st_ino}"
    with held(f"session {session} of {study.resolve()}", holder, known_as=known_as):
        yield


def _holder(said: Path) -> str:
    try:
        holder = json.loads(said.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return "another session"
    return f"{holder['holder']} (process {holder['process']})"


def _folder() -> Path:
    """A folder that belongs to this user alone and is emptied by the system.

    Everybody must come to the same one, so that it does not follow TMPDIR where there is a /tmp.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    common = Path("/tmp")  # noqa: S108 - the folder in it is the user's own
    folder = (common if common.is_dir() else Path(tempfile.gettempdir())) / f"touchbeam-held-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder
