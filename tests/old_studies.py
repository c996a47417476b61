"""Studies of earlier versions, kept as text in tests/data, and made files again for a test."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

DATA = Path(__file__).parent / "data"


def old_study(name: str, folder: Path) -> Path:
    """Copy the study kept as `name` into the new `folder`, and make its journal of `study.sql`."""
    shutil.copytree(DATA / name, folder)
    script = folder / "study.sql"
    with closing(sqlite3.connect(folder / "study.db")) as connection:
        connection.executescript(script.read_text(encoding="utf-8"))
    script.unlink()
    return folder
