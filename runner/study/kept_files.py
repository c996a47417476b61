"""Results that are kept: in the user's own cache, a folder for each study, and those of `power`.

Those in the cache are in no study's folder, which a stranger may have made, and nobody else can
read them or have written them. A file that was damaged is removed; where nothing can be written,
nothing is kept, and no command fails.
"""

import os
import platform
import secrets
import shutil
import stat
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import file_digest, sha256
from importlib.metadata import version
from pathlib import Path
from typing import ClassVar

from protocol.errors import WorkFailed
from runner.journal.database import log_of
from runner.journal.store import Journal
from runner.study.files import create, opened_itself, require_end, state_folder, write_files

VARIABLE = "TOUCHBEAM_CACHE"
"""Names another folder than the user's cache, or is `off`."""
OFF = "off"
MOST_BYTES = 512 * 2**20
"""Of all kept results; beyond it, those that were used longest ago are removed."""
_DIGEST_BYTES = 32
_LIBRARIES = ("touchbeam", "numpy", "scipy", "pandas", "matplotlib")


class KeptFiles:
    """The kept results of one study, each after its digest: a damaged one is as good as none."""

    _written: ClassVar[dict[Path, int]] = {}
    """How much was written since there was last too much, by the folder of all studies."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._withdrawn = _mark(folder)

    def get(self, name: str) -> bytes | None:
        path = self._folder / name
        try:
            with open(path, "rb", opener=opened_itself) as file:
                stored = file.read(MOST_BYTES)
            digest, content = stored[:_DIGEST_BYTES], stored[_DIGEST_BYTES:]
            if digest == _digest(name, content):
                os.utime(path)  # so that it is not among those used longest ago
                return content
            # A damaged file would be read in vain each time.
            path.unlink()
        except OSError:
            pass
        return None

    def put(self, name: str, content: bytes) -> None:
        """Keep the content under that name, whole or not at all."""
        everything = self._folder.parent
        beside = self._folder / f".{secrets.token_hex(8)}"
        try:
            everything.mkdir(0o700, parents=True, exist_ok=True)
            # In a folder where others can write, a result could be theirs.
            if not _is_private(everything):
                return
            self._folder.mkdir(0o700, exist_ok=True)
            try:
                create(beside, _digest(name, content) + content, 0o600)
                # Renamed when it is whole, because another process may read it at any moment.
                beside.replace(self._folder / name)
                # What was computed before a withdrawal must not come back after it.
                if _mark(self._folder) != self._withdrawn:
                    (self._folder / name).unlink()
            finally:
                beside.unlink(missing_ok=True)
        except OSError:
            return
        written = self._written.get(everything, MOST_BYTES) + len(content)
        if written > MOST_BYTES // 16:  # to look at all of them each time would take longer
            _remove_oldest(everything)
            written = 0
        self._written[everything] = written


def kept_files(journal: Journal) -> KeptFiles | None:
    """Return the kept results of the study with this journal; None if nothing is to be kept."""
    everything = _everything()
    if os.environ.get(VARIABLE) == OFF or (everything.exists() and not _is_private(everything)):
        return None
    return KeptFiles(everything / _name_of(journal))


def forget(journal: Journal) -> Path | None:
    """Remove all kept results of the study; return their folder if something is left.

    Whoever still computes some from what is erased keeps nothing more.
    """
    folder = _everything() / _name_of(journal)
    with suppress(OSError):
        folder.parent.mkdir(0o700, parents=True, exist_ok=True)
        # Where others can write, nothing is kept, and the mark could be a link of theirs. It comes
        # before anything is removed, so that what is put meanwhile is found by one of the two.
        if _is_private(folder.parent):
            _mark_of(folder).write_bytes(secrets.token_bytes(8))
    shutil.rmtree(folder, ignore_errors=True)
    return folder if folder.exists() else None


def _mark_of(folder: Path) -> Path:
    return folder.with_suffix(".withdrawn")


def _mark(folder: Path) -> bytes:
    """Return what tells one withdrawal from the next; nothing before the first."""
    try:
        with open(_mark_of(folder), "rb", opener=opened_itself) as file:
            return file.read(8)
    except OSError:
        return b""


def journal_digest(path: Path) -> str:
    """Return the digest of the journal's bytes, those in its log among them."""
    digest = sha256()
    for each in (path, log_of(path)):
        if each.is_file():  # opening the journal refuses a folder or a pipe, which never ends
            with suppress(FileNotFoundError), each.open("rb") as file:
                digest.update(file_digest(file, "sha256").digest())
        digest.update(b"|")
    return digest.hexdigest()


def code_version() -> str:
    """Return what results depend on beside data: code, by its files too, libraries, machine."""
    own = Path(__file__).parents[2]
    rooms = ("protocol", "device", "analysis", "runner", "touchbeam")
    # No compiled files, which the first run after a change of the code writes.
    files = [path for room in rooms for path in sorted((own / room).rglob("*.[ph]*[yl]"))]
    known = ((str(path.relative_to(own)), path.stat()) for path in files)
    stamps = [(name, status.st_size, status.st_mtime_ns) for name, status in known]
    libraries = [f"{name} {version(name)}" for name in _LIBRARIES]
    return repr([platform.python_version(), platform.machine(), libraries, stamps])


def _everything() -> Path:
    from platformdirs import user_cache_path

    given = os.environ.get(VARIABLE, OFF)
    # A relative one could lie in a study's folder.
    if given != OFF and Path(given).is_absolute():
        return Path(given)
    return user_cache_path("touchbeam", appauthor=False) / "results"


def _name_of(journal: Journal) -> str:
    """Return what all copies of a journal have in common, and keep when something is erased."""
    chains = journal.sessions()
    first = next(journal.chain(chains[0])).hash if chains else ""
    return sha256(first.encode("utf-8", "surrogatepass")).hexdigest()[:32]


def _digest(name: str, content: bytes) -> bytes:
    return sha256(name.encode() + b"\0" + content).digest()


def _is_private(folder: Path) -> bool:
    """Return whether it is a folder of this user's, in which nobody else can write."""
    status = folder.lstat()
    if sys.platform == "win32":  # there it lies in the user's own profile
        return stat.S_ISDIR(status.st_mode)
    mine = status.st_uid == os.geteuid() and not status.st_mode & 0o022
    return stat.S_ISDIR(status.st_mode) and mine


def _remove_oldest(everything: Path) -> None:
    known = []
    for path in everything.glob("*/*"):
        with suppress(OSError):  # another process may have removed it
            status = path.lstat()
            known.append((status.st_mtime, status.st_size, path))
    total = 0
    for _, size, path in sorted(known, reverse=True):
        total += size
        if total > MOST_BYTES:
            with suppress(OSError):
                path.unlink()


# The folder of power analyses in a study's folder: figures, and results kept between runs.

_KEY_BYTES = 32
_LARGEST_CHUNK = 2**26


def own_key() -> bytes:
    """Return the key that seals kept results, which nobody has who may have sent a study.

    Raise `WorkFailed` if it is not what touchbeam has written, `OSError` if it cannot be kept.
    """
    path = state_folder() / "power.key"
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    # Of two processes that begin at once, one makes the key and the other reads it.
    with suppress(FileExistsError):
        create(path, secrets.token_bytes(_KEY_BYTES), 0o600)
    key = path.read_bytes()
    if len(key) != _KEY_BYTES:
        raise WorkFailed(f"{path}: must have {_KEY_BYTES} bytes, got {len(key)}; delete it")
    return key


@dataclass(frozen=True, kw_only=True)
class PowerFolder:
    """`power` in a study's folder; `digest` tells the results of one simulation from others."""

    study: Path
    digest: str
    key: bytes = field(repr=False)

    @property
    def path(self) -> Path:
        return self.study / "power"

    @property
    def chunks(self) -> Path:
        """Kept results of this simulation."""
        return self.path / "chunks" / self.digest[:16]

    def load(self, name: str) -> bytes | None:
        """Return what was kept, if anything; b'' if it is too long, `BadInput` for a pipe."""
        kept = self.chunks / f"{name}.npy"
        require_end(kept)
        try:
            # Nothing, but not None: it is there, and the warning counts it.
            return kept.read_bytes() if kept.stat().st_size <= _LARGEST_CHUNK else b""
        except FileNotFoundError:
            return None

    def save(self, name: str, content: bytes) -> None:
        """Keep it, atomically."""
        write_files({f"{name}.npy": content}, self.chunks, study=self.study)

    def write(self, contents: Mapping[str, bytes]) -> None:
        write_files(contents, self.path, study=self.study)
