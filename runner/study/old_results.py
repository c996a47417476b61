"""Files in a study's folder, beside its journal, that still hold a withdrawn participant."""

import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from protocol.study_file.loading import picture_names
from runner.journal.database import log_of
from runner.study.mentions import Budget, NotSearched, Person, Picture, drawn_as_text, file_names

MOST_FILES = 20_000
MOST_BYTES = 512 * 2**20
_TOPS = ("report.json", "trials.csv", "dataset_description.json")
"""The folder of a report or an export has one of these files."""
_HISTORY = ".git"
"""Holds all that a file ever was, compressed in a way of its own."""


@dataclass(frozen=True, kw_only=True)
class OldResults:
    """What still names a participant, relative to the study's folder.

    A report or an export is named by its folder, another file by itself. `unsearched` are the files
    that are unreadable, beyond the limits of the search, or of a kind without text.
    """

    holding: tuple[str, ...]
    unsearched: tuple[str, ...]


def old_results(study: Path, person: Person) -> OldResults:
    """Search the folder `study`, its journal apart, for a person; follow no links.

    A figure holds what its SVG holds, in whose file texts are texts; a log goes with its journal.
    """
    holding: set[Path] = set()
    unsearched: dict[Path, NotSearched | OSError] = {}
    budget, paths = Budget(files_left=MOST_FILES, bytes_left=MOST_BYTES), list[Path]()
    for path in _files(study, unsearched):
        paths.append(path)
        try:
            inside = path.relative_to(study).as_posix()
            if person.is_in_path(inside) or file_names(path, person, budget):
                holding.add(path)
        # Told, so that nobody takes a search that was cut short for a clean result.
        except (OSError, NotSearched) as error:
            unsearched[path] = error
    for path in [path for path, error in unsearched.items() if isinstance(error, Picture)]:
        if drawn := [Path(name) for name in drawn_as_text(str(path)) if Path(name).is_file()]:
            del unsearched[path]
            holding |= {path} if holding.intersection(drawn) else set()
    holding |= {path for path in paths if _database_of(path) in holding}
    results = (_result(path, study) for path in paths if path in holding)
    left = unsearched.keys() - holding - {study / name for name in _own_pictures(study)}
    return OldResults(
        holding=tuple(str(path.relative_to(study)) for path in dict.fromkeys(results)),
        unsearched=tuple(sorted(str(path.relative_to(study)) for path in left)),
    )


def _database_of(path: Path) -> Path | None:
    """Return the database whose log, or index of a log, has this name."""
    for end in ("-wal", "-shm"):
        if path.name.endswith(end):
            return path.with_name(path.name.removesuffix(end))
    return None


def _own_pictures(study: Path) -> list[str]:
    """Return the names of the pictures that the study shows to everybody."""
    try:
        return picture_names((study / "study.toml").read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return []


def _result(path: Path, study: Path) -> Path:
    # From the outermost folder, because an export may contain a report.
    inside = reversed(path.relative_to(study).parents[:-1])
    folders = (study / folder for folder in inside)
    with_tops = (folder for folder in folders if any((folder / top).is_file() for top in _TOPS))
    return next(with_tops, path)


def _files(study: Path, unsearched: dict[Path, NotSearched | OSError]) -> Iterator[Path]:
    """Yield the files below `study` but its journal, without links, pipes and devices."""

    def barred(error: OSError) -> None:
        unsearched[Path(error.filename)] = error

    journal = study / "study.db"
    own = {journal, log_of(journal), journal.with_name("study.db-shm")}
    for place, folders, names in os.walk(study, onerror=barred):
        folders.sort()
        if _HISTORY in folders:
            folders.remove(_HISTORY)
            unsearched[Path(place, _HISTORY)] = NotSearched()
        for path in (Path(place, name) for name in sorted(names)):
            if path not in own and not path.is_symlink() and path.is_file():
                yield path


_OF_A_STUDY = re.compile(r"[0-9a-f]{32}(?:\.withdrawn)?")


def old_caches() -> list[Path]:
    """Return the folders in which earlier versions kept results for this user, as far as there."""
    if sys.platform == "win32":
        place = Path(os.environ.get("LOCALAPPDATA", "")) / "touchbeam" / "Cache"
    elif sys.platform == "darwin":
        place = Path.home() / "Library" / "Caches" / "touchbeam"
    else:
        place = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "touchbeam"
    folders = [place] if place.is_absolute() and place.is_dir() else []
    # A folder that the user named may have other files, too, which nobody is told to delete.
    named = Path(os.environ.get("TOUCHBEAM_CACHE", ""))
    if named.is_absolute() and named.is_dir():
        entries = [entry.name for entry in named.iterdir()]
        folders += [named] * (bool(entries) and all(map(_OF_A_STUDY.fullmatch, entries)))
    return folders
