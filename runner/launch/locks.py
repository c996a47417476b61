"""Locks that allow one session per rig, and one process per session, at a time.

They hold between the processes of one user: in a folder that all users can write to, one could keep
another from a rig, or lead its locks elsewhere. docs/rig.md says what follows from that.

Their files may outlive the process. They contain its number and nothing else, and their names tell
nothing about participants: an erased participant leaves no trace here.
"""

import hashlib
import os
import shlex
import socket
import stat
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

from filelock import FileLock, Timeout

from protocol.address import SIMULATED
from protocol.errors import WorkFailed
from protocol.study.fields import printable
from runner.study.files import opened_itself

_ON_A_NETWORK = {"socket", "rfc2217"}
COMMON = Path("/tmp")  # noqa: S108 - the locks are in a folder that only the user can open


class RigInUse(WorkFailed):
    """Another process holds the rig or the session."""


class NoLocks(WorkFailed):
    """The folder of the locks is on a file system that has none."""


class UnsafeFolder(WorkFailed):
    """Other users can write to the folder of the locks, or may have created it."""


def rig_lock(url: str, common: Path = COMMON) -> AbstractContextManager[None]:
    """Lock the rig, by its real address, while the body runs; a simulated one needs no lock.

    Every process of this user finds the folder `common`. Raise `RigInUse` with the other's command,
    `NoLocks` without any in this system, and `UnsafeFolder` if others can open the folder.
    """
    return _lock(url, real_address(url), common) if url != SIMULATED else nullcontext()


@contextmanager
def _lock(what: str, identity: str, common: Path) -> Iterator[None]:
    """Lock `what`, identified by `identity`; the system releases the lock if the process dies."""
    folder, name = _folder(common), _file_name(identity)
    # Of the process, not of a thread: whichever thread ends the body releases it.
    lock = FileLock(folder / f"{name}.lock", thread_local=False)
    holder_file = folder / f"{name}.process"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # that it takes a lock which outlives its process
            lock.acquire(timeout=0)
    except Timeout:
        raise RigInUse(
            f"{what} is in use by {_holder(holder_file)}; end that session first"
        ) from None
    except (OSError, UserWarning) as error:
        if isinstance(error, OSError) and error.filename is not None:  # a full disk, for example
            raise
        raise NoLocks(
            f"{folder}: cannot lock {what} ({getattr(error, 'strerror', error)}): the folder is on "
            "a network, or this computer has no locks left; keep it on a local disk, or restart"
        ) from error
    try:
        holder_file.unlink(missing_ok=True)  # never written through a link in its place
        with holder_file.open("x", encoding="ascii") as file:
            file.write(str(os.getpid()))
        yield
    finally:
        holder_file.unlink(missing_ok=True)  # before the release: the next holder writes its own
        lock.release()


def session_lock(session: str, study: Path) -> AbstractContextManager[None]:
    """Lock a session of the study in the folder `study`, by the folder's inode, as `rig_lock`."""
    return _lock(f"session {session} of {study.resolve()}", _identity(session, study), COMMON)


def _identity(session: str, study: Path) -> str:
    place = study.stat()
    return f"session {session} of {place.st_dev}:{place.st_ino} {_boot()}"


def _file_name(identity: str) -> str:
    """Return the name of a lock's files: what it locks may contain any character."""
    return hashlib.sha256(identity.encode()).hexdigest()[:24]


def held_sessions(sessions: Iterable[str], study: Path) -> set[str]:
    """Return which of `sessions` a process runs; no lock is taken, so that none is turned away."""
    try:
        folder = _folder(COMMON)
    except UnsafeFolder:  # nobody could run a session, either
        return set()
    places = {name: folder / f"{_file_name(_identity(name, study))}.process" for name in sessions}
    return {name for name, place in places.items() if _is_held(place)}


def _is_held(holder_file: Path) -> bool:
    import psutil

    try:
        wrote_s = holder_file.lstat().st_mtime
        with open(holder_file, encoding="ascii", opener=opened_itself) as file:
            return bool(psutil.Process(int(file.read(20))).create_time() <= wrote_s + 1)
    except (OSError, ValueError, psutil.Error):
        return False


def _boot() -> str:
    """Return the random name of this run of the system, which no file keeps to find sessions by."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text("ascii")
    except OSError:
        return ""


def real_address(url: str) -> str:
    """Return the numeric host and port, one for this machine, or the real path behind `url`."""
    if "://" not in url:
        return os.path.realpath(url)
    try:
        parts = urlsplit(url)
        if parts.scheme not in _ON_A_NETWORK:
            return url
        known = socket.getaddrinfo(parts.hostname, parts.port, type=socket.SOCK_STREAM)
    except (OSError, ValueError):  # opening it will give the right error
        return url
    return f"{min(_one_spelling(place[-1][0]) for place in known)} {parts.port}"


def _one_spelling(host: str | int) -> str:
    """Return the numeric `host` as IPv4 if it is one mapped to IPv6, and each loopback as one."""
    found = ip_address(host)
    found = getattr(found, "ipv4_mapped", None) or found
    here = found.is_loopback or found.is_unspecified  # systems connect 0.0.0.0 to themselves
    return "this machine" if here else str(found)


def _holder(path: Path) -> str:
    """Return the process that holds a lock, with its command and folder as the system has them."""
    import psutil

    try:
        with open(path, encoding="ascii", opener=opened_itself) as file:
            process = psutil.Process(int(file.read(20)))
        command, place = process.cmdline(), process.cwd()
    except (OSError, ValueError, psutil.Error):
        return "another session"
    words = " ".join(shlex.join(command[1:]).split())
    return printable(f"{words} in {place} (process {process.pid})")


def _folder(common: Path) -> Path:
    """Return the folder of the locks, which only this user can open and the system empties.

    All processes of a user must find the same one: in /tmp, and not in XDG_RUNTIME_DIR, which cron
    and sudo do not set and a logout removes, unless another user has taken the name in /tmp.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    place = common if common.is_dir() else Path(tempfile.gettempdir())
    try:
        return _own_folder(place / f"touchbeam-held-{user}")
    except UnsafeFolder:
        runtime = Path(os.environ.get("XDG_RUNTIME_DIR", ""))
        if not runtime.is_absolute() or not runtime.exists() or _unsafe(runtime):
            raise
        return _own_folder(runtime / "touchbeam-held")


def _own_folder(path: Path) -> Path:
    """Return the folder `path`, made if missing; raises `UnsafeFolder` if others can open it."""
    with suppress(FileExistsError):
        path.mkdir(mode=0o700)
    if found := _unsafe(path):
        raise UnsafeFolder(
            f"{path}: must be a folder that only this user can open, got {found}; remove it, or "
            "ask an administrator to"
        )
    return path


def _unsafe(path: Path) -> str:
    """Return what is at `path` if it is not a folder that only this user can open, else ''."""
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode):
        return "a link" if stat.S_ISLNK(found.st_mode) else "a file"
    if not hasattr(os, "getuid"):  # Windows: others cannot open a user's temporary folder
        return ""
    if found.st_uid != os.getuid():
        return "a folder of another user"
    mode = stat.S_IMODE(found.st_mode)
    return "" if mode & 0o777 == 0o700 else f"a folder with mode {mode:04o}"
