"""The one place where an export touches the disk: a new folder, there as a whole or not at all."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from protocol.errors import BadInput


def write_new_folder(contents: Mapping[str, str], folder: Path) -> Path:
    """Write `contents`, text by relative path, into the new folder `folder`; return its path.

    Everything is written beside it first and takes its name in one step. What fails leaves nothing
    behind.

    Raises:
        BadInput: the folder is there and not empty, or is no folder.
        OSError: it cannot be written.
    """
    place = folder.resolve()
    _require_free(place, folder)
    with (
        _folders_above(place.parent),
        TemporaryDirectory(prefix=f".{place.name}-", dir=place.parent) as beside,
    ):
        whole = Path(beside) / "whole"
        for name, text in contents.items():
            path = whole / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode())
        if place.exists():
            place.rmdir()  # empty; Windows renames no folder onto another
        whole.rename(place)
    return folder


def _require_free(place: Path, given: Path) -> None:
    if place.exists() and not place.is_dir():
        raise BadInput(f"{given}: is a file; name a folder to make")
    if place.exists() and any(place.iterdir()):
        raise BadInput(f"{given}: is there already and not empty; name a folder to make")


@contextmanager
def _folders_above(parent: Path) -> Iterator[None]:
    """Make what is missing of `parent`; if the body fails, it is missing again."""
    missing = [path for path in (parent, *parent.parents) if not path.exists()]
    parent.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        for path in missing:
            path.rmdir()
        raise
