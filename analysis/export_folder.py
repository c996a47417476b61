"""The one place where an export touches the disk: a new folder, there as a whole or not at all."""

import os
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from analysis.made_folder import made_folder
from protocol.errors import BadInput


def write_new_folder(contents: Mapping[str, str], folder: Path) -> Path:
    """Write `contents`, text by relative path, into the new folder `folder`; return its path.

    Everything is written beside it first and takes its name in one step. What fails leaves nothing
    behind.

    Raises:
        BadInput: the folder is there and not empty, or is no folder.
        OSError: it cannot be written; the error names `folder`.
    """
    place = Path(os.path.realpath(folder))
    _require_free(place, folder)
    try:
        _write(contents, place)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from error
    return folder


def _write(contents: Mapping[str, str], place: Path) -> None:
    with (
        made_folder(place.parent) as parent,
        TemporaryDirectory(prefix=".touchbeam-", dir=parent) as beside,
    ):
        whole = Path(beside) / "whole"
        for name, text in contents.items():
            path = whole / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode())
        if place.exists():
            place.rmdir()  # empty; Windows renames no folder onto another
        whole.rename(place)


def _require_free(place: Path, given: Path) -> None:
    if place.exists() and not place.is_dir():
        raise BadInput(f"{given}: is a file; name a folder to make")
    if place.exists() and any(place.iterdir()):
        raise BadInput(f"{given}: is there already and not empty; name a folder to make")
