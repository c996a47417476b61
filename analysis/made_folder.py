"""A folder for results, made with all that is missing above it, and taken away if they fail."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from errno import ENOTDIR
from pathlib import Path


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
