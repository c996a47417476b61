"""One session per rig at a time: who holds a rig, and what a second one is told."""

import hashlib
import json
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from urllib.parse import urlsplit

from filelock import FileLock, Timeout

from protocol.errors import WorkFailed

_ON_A_NETWORK = {"socket", "rfc2217"}


class RigHeld(WorkFailed):
    """Another process has the rig, or the session."""


@contextmanager
def rig_held(url: str, holder: str) -> Iterator[None]:
    """Hold the rig at `url`, by whatever address one comes to it, while the body runs.

    A simulated one is everybody's own.

    Args:
        url: a serial port's path or URL.
        holder: what somebody else is told, such as the session's name and the study's folder.

    Raises:
        RigHeld: another process has it; the message says which session.
    """
    from runner.rigging import SIMULATED  # heavy, and loaded already where there is a rig

    with nullcontext() if url == SIMULATED else _held(url, holder, known_as=_rig(url)):
        yield


@contextmanager
def _held(what: str, holder: str, *, known_as: str) -> Iterator[None]:
    """Hold `what`, which `known_as` tells from others; the lock ends with the process."""
    folder = _folder()
    name = hashlib.sha256(known_as.encode()).hexdigest()[:24]
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
    with _held(f"session {session} of {study.resolve()}", holder, known_as=known_as):
        yield


def _rig(url: str) -> str:
    """What an address leads to: a host and a port by number, a device by its real path."""
    if "://" not in url:
        return os.path.realpath(url)
    try:
        parts = urlsplit(url)
        if parts.scheme not in _ON_A_NETWORK:
            return url
        known = socket.getaddrinfo(parts.hostname, parts.port, type=socket.SOCK_STREAM)
    except (OSError, ValueError):  # whoever opens it will say what is wrong with it
        return url
    return repr(min(known)[-1][:2])


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
