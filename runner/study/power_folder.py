"""The folder of power analyses in a study's folder: figures, and results kept between runs."""

import secrets
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from protocol.errors import WorkFailed
from runner.study.files import create, require_end, state_folder, write_files

_KEY_BYTES = 32
_LARGEST_CHUNK = 2**26


def own_key() -> bytes:
    """Return the key that seals kept results, which nobody has who may have sent a study.

    Raises:
        WorkFailed: it is not what touchbeam has written.
        OSError: it cannot be read or written.
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
        """The folder of figures and numbers."""
        return self.study / "power"

    @property
    def chunks(self) -> Path:
        """Kept results of this simulation."""
        return self.path / "chunks" / self.digest[:16]

    def load(self, name: str) -> bytes | None:
        """Return what was kept under a name, if anything; nothing of what is too long to be that.

        Raises:
            BadInput: a pipe or a device is there.
        """
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
        """Write figures and numbers."""
        write_files(contents, self.path, study=self.study)
