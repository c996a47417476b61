"""What a study touches: the beam it describes, or the table of friction in its folder."""

import csv
from hashlib import sha256
from io import StringIO
from pathlib import Path

from device.friction.surfaces import (
    AnySurface,
    GivenSurface,
    MeasuredSurface,
    beam_surface,
    friction_table,
)
from protocol.errors import BadInput
from protocol.study.study import Study
from protocol.study.surface import is_table_name
from runner.study.files import bytes_of, require_no_link, text_of

MOST_BYTES = 100_000_000


def table_digest(folder: Path, name: str) -> str | None:
    """Return the SHA-256 of a table in the study's folder; None for a file that may not be read."""
    if not is_table_name(name):
        return None
    try:
        return sha256(_content(folder, name)).hexdigest()
    except BadInput:
        return None


def _content(folder: Path, name: str) -> bytes:
    path = folder.resolve() / name
    # No link in its path: it could otherwise be any file of the user.
    if path.resolve() != path:
        raise BadInput(f"{path}: must not be a link, or lie behind one")
    require_no_link(path)
    return bytes_of(path, most=MOST_BYTES)


def surface_of(folder: Path, study: Study) -> AnySurface:
    """Return the surface of a study in this folder.

    Raise `BadInput` for a table that is missing, damaged, or another one than the study's.
    """
    surface = study.surface
    if surface.kind == "beam":
        return beam_surface(surface)
    length_m = surface.length_m
    assert length_m is not None
    if surface.kind == "given":
        return GivenSurface(length_m=length_m)
    name = surface.table
    assert name is not None
    path = folder / name
    content = _content(folder, name)
    digest = sha256(content).hexdigest()
    if study.tables.get(name) not in {None, digest}:
        raise BadInput(
            f"{path}: has changed since the study was recorded with it; restore it, or record the "
            "change by `touchbeam amend`"
        )
    try:
        rows = list(csv.reader(StringIO(text_of(content, path), newline=""), strict=True))
    except csv.Error as error:
        raise BadInput(f"{path}: not a table with commas ({error})") from None
    table = friction_table(rows, str(path), digest)
    return MeasuredSurface(length_m=length_m, table=table)
