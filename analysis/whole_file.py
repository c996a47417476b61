"""A result becomes a file, whole or not at all; a pipe or a device is written to as it is."""

import os
import re
import secrets
from pathlib import Path

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
