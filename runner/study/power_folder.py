"""The folder of power analyses in a study's folder: figures, and results kept between runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from runner.study.files import require_end, write_files


@dataclass(frozen=True, kw_only=True)
class PowerFolder:
    """`power` in a study's folder; `digest` tells the results of one simulation from others."""

    study: Path
    digest: str

    @property
    def path(self) -> Path:
        """The folder of figures and numbers."""
        return self.study / "power"

    @property
    def chunks(self) -> Path:
        """Kept results of this simulation."""
        return self.path / "chunks" / self.digest[:16]

    def load(self, name: str) -> bytes | None:
        """Return what was kept under a name, if anything.

        Raises:
            BadInput: a pipe or a device is there.
        """
        kept = self.chunks / f"{name}.npy"
        require_end(kept)
        try:
            return kept.read_bytes()
        except FileNotFoundError:
            return None

    def save(self, name: str, content: bytes) -> None:
        """Keep it, atomically."""
        write_files({f"{name}.npy": content}, self.chunks, study=self.study)

    def write(self, contents: Mapping[str, bytes]) -> None:
        """Write figures and numbers."""
        write_files(contents, self.path, study=self.study)
