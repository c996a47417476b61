"""A result becomes a file, whole or not at all; a pipe or a device is written to as it is."""

import os
import re
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from errno import ENOTDIR
from pathlib import Path
from tempfile import TemporaryDirectory

from protocol.errors import BadInput

_DESCRIPTORS = re.compile(r"/proc/[^/]+/fd|/dev/fd")


def is_stream(path: Path) -> bool:
    """Return whether `path` is a pipe, a device or an open file of this process, no file by name.

    `/dev/stdout` is one even where it leads to a file: that file is not ours to replace.
    """
    for _ in range(40):
        if _DESCRIPTORS.fullmatch(os.path.realpath(path.parent)):
            return True
        if not path.is_symlink():
            break
        path = path.parent / path.readlink()
    return path.exists() and not path.is_file()


def write_whole(path: Path, data: bytes) -> None:
    """Write `data` to `path`; what fails leaves the file as it was.

    A link is followed, and a file that was there keeps its permissions.

    Raises:
        BadInput: it is a folder.
        OSError: it cannot be written; the error names `path`.
    """
    if path.is_dir():
        raise BadInput(f"{path}: must be a file, got a folder")
    try:
        if is_stream(path):
            path.write_bytes(data)
        else:
            _replaced(Path(os.path.realpath(path)), data)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _replaced(place: Path, data: bytes) -> None:
    """Put a file with `data` in the place of what was there, in one step."""
    there = place.exists() or place.is_symlink()
    if there:
        # Refuses a file that is not ours to write, and a link that leads to itself.
        os.close(os.open(place, os.O_WRONLY))
    beside = place.with_name(f".touchbeam-{secrets.token_hex(8)}")
    try:
        with beside.open("xb") as file:
            if there:
                beside.chmod(place.stat().st_mode & 0o7777)
            file.write(data)
        beside.replace(place)
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def made_folder(folder: Path) -> Iterator[Path]:
    """Make `folder` for the body to fill; yield where it really is.

    If the body fails, what was not there before is not there again.

    Raises:
        OSError: it cannot be made; the error names `folder`.
    """
    place = Path(os.path.realpath(folder))
    missing = [path for path in (place, *place.parents) if not path.exists()]
    try:
        _make(place, folder)
        yield place
    except BaseException:
        if missing:
            shutil.rmtree(missing[-1], ignore_errors=True)
        raise


def _make(place: Path, given: Path) -> None:
    try:
        place.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR), str(given)) from None
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(given)) from error


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
