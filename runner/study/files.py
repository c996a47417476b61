"""Atomic writing of files and folders; pipes and devices are written in place.

Reports and exports are private: other users of the computer can read neither folders nor files.
"""

import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from errno import ENOTDIR
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from protocol.errors import BadInput
from protocol.study_file.toml import LONGEST_TEXT

_PRIVATE_FOLDER = 0o700
_PRIVATE_FILE = 0o600
_DESCRIPTORS = re.compile(r"/proc/[^/]+/fd|/dev/fd")


def bytes_of(path: Path, *, most: int | None = None) -> bytes:
    """Return the content of the file `path`.

    Raise `BadInput` if it is missing or unreadable or, where there is a limit, has more than `most`
    bytes or is a pipe or a device.
    """
    try:
        return path.read_bytes() if most is None else _short_bytes(path, most)
    except FileNotFoundError:
        raise BadInput(f"{path}: no such file") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror})") from error


def require_end(path: Path) -> None:
    """Raise `BadInput` for a pipe or a device, which may never end."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise BadInput(f"{path}: must be a file, got a pipe or a device")


def require_no_link(path: Path) -> None:
    """Raise `BadInput` for a link, pipe or device: it could lead to another person's file."""
    require_end(path)
    if path.is_symlink():
        raise BadInput(f"{path}: must be a file, got a link; put the file itself there")


def text_of(content: bytes, path: Path) -> str:
    """Decode `content` of `path`, without a byte order mark; `BadInput` if it is not UTF-8."""
    try:
        # Some editors on Windows begin a file with a byte order mark.
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise BadInput(
            f"{path}: cannot be read as UTF-8 text at line {line}; save the file as UTF-8"
        ) from error


def short_text(path: Path) -> str:
    """Return the text of the file `path`, without a byte order mark; `BadInput` as both above."""
    # One form of line ends, so that a study has the same digest on every system.
    text = text_of(bytes_of(path, most=LONGEST_TEXT), path)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _short_bytes(path: Path, most: int) -> bytes:
    require_end(path)
    # Asked before it is read: a file from somebody else may be larger than the memory.
    size = path.stat().st_size
    if size > most:
        rule = f"{most} bytes, got {size}"
        if most % 2**20 == 0:
            rule = f"{most // 2**20} MiB, got {-(-size // 2**20)}"
        raise BadInput(f"{path}: must have at most {rule}")
    return path.read_bytes()


def state_folder() -> Path:
    """Return the folder for what touchbeam keeps of this user on this computer."""
    for name in ("XDG_STATE_HOME", "LOCALAPPDATA"):
        folder = Path(os.environ.get(name, ""))
        if folder.is_absolute():  # else it could lie in a study
            return folder / "touchbeam"
    return Path.home() / ".local" / "state" / "touchbeam"


def own_file(path: Path, study: Path) -> Path:
    """Return `path`, a file below the folder `study` that touchbeam names itself and will write.

    What the user names may be a link or a pipe. Here it could come with a study from somebody
    else, and lead touchbeam to write another file: `BadInput` for links and what is no file.
    """
    depth = len(path.relative_to(study).parts)
    # The study's folder itself may be a link, which its user made.
    for place in (path, *path.parents[: depth - 1]):
        if place.is_symlink():
            raise BadInput(f"{place}: touchbeam writes here and follows no link; move it away")
    if path.exists() and not path.is_file():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        raise BadInput(f"{path}: must be a file, got {kind}; move it away")
    return path


def is_stream(path: Path) -> bool:
    """Return whether `path` is a pipe, a device or an open descriptor, not a file by name.

    `/dev/stdout` counts as a stream even if it leads to a file: that file must not be replaced.
    """
    # As many links as Linux follows; links that lead to each other would never end.
    for _ in range(40):
        if _DESCRIPTORS.fullmatch(os.path.realpath(path.parent)):
            return True
        if not path.is_symlink():
            break
        path = path.parent / path.readlink()
    return path.exists() and not path.is_file()


def write_whole(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Write `data` to `path`, through links; a failure leaves an existing file unchanged.

    `mode` are the permissions of a new file, before the umask; an existing one keeps its own. Raise
    `BadInput` for a folder, and `OSError`, which names `path`.
    """
    if path.is_dir():
        raise BadInput(f"{path}: must be a file, got a folder")
    try:
        # A pipe cannot be replaced by another file.
        if is_stream(path):
            path.write_bytes(data)
        else:
            # The file behind a link is replaced, and the link stays.
            _replace(Path(os.path.realpath(path)), data, mode)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _replace(place: Path, data: bytes, mode: int) -> None:
    exists = place.exists() or place.is_symlink()
    if exists:
        # Fails for a file without write permission and for a link that leads to itself.
        os.close(os.open(place, os.O_WRONLY))
    # In the same folder, because a file can be renamed within one file system only.
    beside = place.with_name(f".touchbeam-{secrets.token_hex(8)}")
    try:
        create(beside, data, place.stat().st_mode & 0o7777 if exists else mode)
        if exists:
            # Again, because the umask has narrowed the permissions of the new file.
            beside.chmod(place.stat().st_mode & 0o7777)
        beside.replace(place)
    finally:
        beside.unlink(missing_ok=True)


def opened_itself(path: str, flags: int) -> int:
    """Open `path` for `open`: no link is followed, and no pipe in its place waited for."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def create(path: Path, data: bytes, mode: int) -> None:
    """Create the file `path`, whose permissions are never wider than `mode`."""
    with open(path, "xb", opener=partial(os.open, mode=mode)) as file:
        file.write(data)


def make_folder(place: Path) -> Path | None:
    """Create the private folder `place` and its missing parents, or raise `OSError`.

    Return the topmost new folder, for `take_away`, or None if `place` exists. With `..` or links in
    the path, `take_away` could remove a folder other than the one created: give a real path.
    """
    missing = [place, *(parent for parent in place.parents if not parent.exists())]
    try:
        place.mkdir(_PRIVATE_FOLDER, parents=True)
    except FileExistsError:
        return None
    except BaseException:
        # From the innermost one outwards, because a folder must be empty to be removed.
        for path in missing:
            with suppress(OSError):  # it was not created, or another program already uses it
                path.rmdir()
        raise
    return missing[-1]


def take_away(paths: Iterable[Path]) -> None:
    """Remove `paths`, folders with their content; ignore what cannot be removed."""
    for path in list(paths):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()


@contextmanager
def made_folder(folder: Path) -> Iterator[Path]:
    """Create the private `folder` if it is missing; yield its real path; a failure removes it.

    Raise `OSError`, which names `folder`, if it cannot be created.
    """
    place = Path(os.path.realpath(folder))
    try:
        topmost = make_folder(place)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from error
    if topmost is None and not place.is_dir():
        raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR), str(folder))
    try:
        yield place
    except BaseException:
        # Nothing is taken away that was there before.
        take_away([topmost] if topmost else ())
        raise


def write_files(
    contents: Mapping[str, bytes],
    folder: Path,
    replaced: Iterable[str] = (),
    *,
    study: Path | None = None,
    confirm: Callable[[], None] = lambda: None,
) -> None:
    """Write `contents`, by relative path, into `folder`, made if missing, each file atomically.

    Paths `replaced`, of an earlier call, are removed unless `contents` has them. `study` is the
    folder of a study in which touchbeam, not the user, named `folder`: `own_file` must then allow
    each file, or nothing is written. If `confirm` raises, they are removed again: it is called when
    they are written. Raise `OSError`, which names the file.
    """
    # Without its folder a file is gone already; a link in the folder's place is looked at all the
    # same, wherever it leads.
    gone = [
        name
        for name in replaced
        if name not in contents and os.path.lexists((folder / name).parent)
    ]
    # All paths are looked at before the first is written, so that a refusal leaves nothing half
    # done.
    if study:
        for name in (*contents, *gone):
            own_file(folder / name, study)
    with ExitStack() as stack:
        places = ((folder / name).parent for name in (*contents, *gone))
        for place in dict.fromkeys((folder, *places)):
            stack.enter_context(made_folder(place))
        for name, data in contents.items():
            write_whole(folder / name, data, _PRIVATE_FILE)
        try:
            confirm()
        except BaseException:
            take_away(folder / name for name in (*contents, *gone))
            raise
        # Only after the new files are there: a failure before leaves the old report whole.
        for name in gone:
            (folder / name).unlink(missing_ok=True)


def write_new_folder(
    contents: Mapping[str, bytes], folder: Path, confirm: Callable[[], None] = lambda: None
) -> None:
    """Write `contents`, by relative path, into the new folder `folder`: whole, or nothing at all.

    If `confirm` raises, the folder is removed again: it is called when all is written. Raise
    `BadInput` for a file or a folder that is not empty, `OSError` if it cannot be written.
    """
    place = Path(os.path.realpath(folder))
    if place.exists() and not place.is_dir():
        raise BadInput(f"{folder}: must be a new or empty folder, got a file")
    if place.exists() and any(place.iterdir()):
        raise BadInput(f"{folder}: must be a new or empty folder, but it contains files")
    try:
        _write(contents, place, confirm)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from error


def _write(contents: Mapping[str, bytes], place: Path, confirm: Callable[[], None]) -> None:
    with (
        made_folder(place.parent) as parent,
        TemporaryDirectory(prefix=".touchbeam-", dir=parent) as beside,
    ):
        whole = Path(beside) / "whole"
        for name, data in contents.items():
            path = whole / name
            for inside in reversed(Path(name).parents):
                (whole / inside).mkdir(_PRIVATE_FOLDER, exist_ok=True)
            create(path, data, _PRIVATE_FILE)
        if place.exists():
            place.rmdir()  # it is empty; Windows cannot rename a folder onto another
        whole.rename(place)
        try:
            confirm()
        except BaseException:
            take_away([place])
            raise
