"""Pictures of a study: which files may be shown, and their digests."""

from collections.abc import Iterable
from hashlib import sha256
from io import BytesIO
from pathlib import Path

from protocol.study.study_question import is_picture_name

LARGEST_BYTES = 4_000_000
LARGEST_SIDE = 4_096
_FORMATS = ("PNG", "JPEG")


def picture_digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of each picture in `folder` that may be shown, by name.

    It is a PNG or JPEG file that can be decoded, not too large, and no part of its path is a link.
    """
    return {name: digest for name in names if (digest := _digest(folder, name)) is not None}


def _digest(folder: Path, name: str) -> str | None:
    if not is_picture_name(name):
        return None
    try:
        whole = folder.resolve(strict=True) / name
        if whole.resolve(strict=True) != whole or not whole.is_file():
            return None
        with whole.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except (OSError, ValueError):
        return None
    return sha256(data).hexdigest() if len(data) <= LARGEST_BYTES and _is_shown(data) else None


def _is_shown(data: bytes) -> bool:
    from PIL import Image

    try:
        with Image.open(BytesIO(data), formats=_FORMATS) as picture:
            if max(picture.size) > LARGEST_SIDE:
                return False
            picture.load()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return False
    return True
