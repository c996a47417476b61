"""One session per rig at a time: who holds a rig, and what a second one is told."""

import hashlib
import json
import os
import socket
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from urllib.parse import urlsplit

from filelock import FileLock, Timeout

from protocol.errors import WorkFailed

_ON_A_NETWORK = {"socket", "rfc2217"}
COMMON = Path("/tmp")  # noqa: S108 - the folder in it is the user's own


class RigInUse(WorkFailed):
    """Another process has the rig, or the session."""


class UnsafeFolder(WorkFailed):
    """Other users can write to the folder of the locks, or could have put it there."""


@contextmanager
def rig_lock(url: str, holder: str, common: Path = COMMON) -> Iterator[None]:
    """Hold the rig at `url`, by whatever address one comes to it, while the body runs.

    A simulated one is everybody's own.

    Args:
        url: a serial port's path or URL.
        holder: what somebody else is told, such as the session's name and the study's folder.
        common: a folder that every process of this user finds.

    Raises:
        RigInUse: another process has it; the message says which session.
        UnsafeFolder: the folder of the locks is not this user's alone.
    """
    from runner.launch.rig import SIMULATED

    lock = _held(url, holder, _rig(url), common) if url != SIMULATED else nullcontext()
    with lock:
        yield


@contextmanager
def _held(what: str, holder: str, known_as: str, common: Path) -> Iterator[None]:
    """Hold `what`, which `known_as` tells from others; the lock ends with the process."""
    folder = _folder(common)
    # Names of sessions and addresses of rigs may hold any character; a file name may not.
    name = hashlib.sha256(known_as.encode()).hexdigest()[:24]
    lock, said = FileLock(folder / f"{name}.lock"), folder / f"{name}.json"
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise RigInUse(f"{what} is held by {_holder(said)}; end that session first") from None
    try:
        _say(said, holder)
        yield
    finally:
        said.unlink(missing_ok=True)  # while the lock is held: the next holder writes its own
        lock.release()


@contextmanager
def session_lock(session: str, study: Path, holder: str) -> Iterator[None]:
    """Hold a session of the study in the folder `study`, by whatever path one comes to it.

    Raises:
        RigInUse: another process has it.
        UnsafeFolder: the folder of the locks is not this user's alone.
    """
    place = study.stat()
    known_as = f"session {session} of {place.st_dev}:{place.st_ino}"
    with _held(f"session {session} of {study.resolve()}", holder, known_as, COMMON):
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


def _say(said: Path, holder: str) -> None:
    """Write who holds the lock into a new file, never through a link that lies in its place."""
    said.unlink(missing_ok=True)
    with said.open("x", encoding="utf-8") as file:
        json.dump({"holder": holder, "process": os.getpid()}, file)


def _holder(said: Path) -> str:
    try:
        with open(said, encoding="utf-8", opener=_not_through_a_link) as file:
            holder = json.load(file)
    except (OSError, ValueError):
        return "another session"
    return f"{holder['holder']} (process {holder['process']})"


def _not_through_a_link(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0))


def _folder(common: Path) -> Path:
    """Return the folder of the locks, which belongs to this user alone and the system empties.

    All processes of a user must find the same one. It is therefore in /tmp, where there is one,
    and not in XDG_RUNTIME_DIR, which cron and sudo do not set and which ends with the last login.
    That folder serves only where somebody else has taken the place in /tmp.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    place = common if common.is_dir() else Path(tempfile.gettempdir())
    try:
        return _own_folder(place / f"touchbeam-held-{user}")
    except UnsafeFolder:
        runtime = Path(os.environ.get("XDG_RUNTIME_DIR", ""))
        if not runtime.is_absolute() or not runtime.exists() or _not_own(runtime):
            raise
        return _own_folder(runtime / "touchbeam-held")


def _own_folder(path: Path) -> Path:
    """Return the folder `path`, made if there is none; nobody else can write to it."""
    with suppress(FileExistsError):
        path.mkdir(mode=0o700)
    if found := _not_own(path):
        raise UnsafeFolder(
            f"{path}: must be a folder that only this user can open, got {found}; remove it, or "
            "ask an administrator to"
        )
    return path


def _not_own(path: Path) -> str:
    """Return what is at `path` if it is not a folder of this user alone, else nothing."""
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode):
        return "a link" if stat.S_ISLNK(found.st_mode) else "a file"
    if not hasattr(os, "getuid"):  # Windows: a user's temporary folder is closed to others
        return ""
    if found.st_uid != os.getuid():
        return "one of another user"
    mode = stat.S_IMODE(found.st_mode)
    return "" if mode & 0o777 == 0o700 else f"one with mode {mode:04o}"
