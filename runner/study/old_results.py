"""Files in a study's folder, beside its journal, that still hold a withdrawn participant."""

import csv
import html
import io
import json
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from runner.journal.database import log_of
from runner.journal.names import parsed_name
from runner.journal.opening import read_journal
from runner.journal.store import JournalError

MOST_FILES = 20_000
MOST_BYTES = 512 * 2**20
_TABLES = {".csv", ".tsv"}
_TEXTS = {".json", ".jsonl", ".html", ".svg", ".tex", ".md", ".txt"}
_WHO = {"participant", "pseudonym", "subject"}
"""The columns of reports and exports that name a participant."""
_TOPS = ("report.json", "trials.csv", "dataset_description.json")
"""The folder of a report or an export has one of these files."""
_DATABASE = b"SQLite format 3\0"
_LOG = (b"\x37\x7f\x06\x82", b"\x37\x7f\x06\x83")
"""The first bytes of SQLite's files."""


@dataclass(frozen=True, kw_only=True)
class OldResults:
    """What still names a participant, relative to the study's folder.

    A report or an export is named by its folder, another file by itself. `unsearched` counts the
    files that are unreadable, beyond the limits of the search, or databases but no journals.
    """

    holding: tuple[str, ...]
    unsearched: int


def old_results(study: Path, participant: str) -> OldResults:
    """Search the folder `study`, its journal apart, for `participant`; follow no links."""
    holding: dict[str, None] = {}
    searched, unsearched, budget = 0, 0, MOST_BYTES
    for path in _files(study):
        try:
            if (holds := _search_of(path)) is None:
                continue
            size, searched = path.stat().st_size, searched + 1
            # Counted and told, so that nobody takes a search that was cut short for a clean result.
            if searched > MOST_FILES or size > budget:
                unsearched += 1
                continue
            budget -= size
            if holds(path, participant):
                holding[str(_result(path, study).relative_to(study))] = None
        except (OSError, JournalError):
            unsearched += 1
    return OldResults(holding=tuple(holding), unsearched=unsearched)


def _search_of(path: Path) -> Callable[[Path, str], bool] | None:
    """Return how to search a file, by its first bytes or its name; None for pictures."""
    # By its first bytes, because a copy of the journal may have any name.
    with path.open("rb") as file:
        start = file.read(len(_DATABASE))
    if start == _DATABASE:
        return _journal_holds
    if start.startswith(_LOG):  # a longer name with this end is found, too
        return lambda log, participant: f"{participant}/".encode() in log.read_bytes()
    return _names if path.suffix in _TEXTS | _TABLES else None


def _journal_holds(path: Path, participant: str) -> bool:
    """Return whether a copy of a journal has a payload of `participant`, rehearsed or not."""
    with read_journal(path) as journal:
        return any(
            not link.event.erased
            for chain in journal.sessions()
            if parsed_name(chain).participant == participant
            for link in journal.chain(chain)
        )


def _result(path: Path, study: Path) -> Path:
    # From the outermost folder, because an export may contain a report.
    inside = reversed(path.relative_to(study).parents[:-1])
    folders = (study / folder for folder in inside)
    with_tops = (each for each in folders if any((each / top).is_file() for top in _TOPS))
    return next(with_tops, path)


def _names(path: Path, participant: str) -> bool:
    # A name can be found in a file that is not all text.
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    if path.suffix in _TABLES:
        return _table_names(text, participant, tabs=path.suffix == ".tsv")
    return re.search(_mention(participant), text) is not None


def _table_names(text: str, participant: str, *, tabs: bool) -> bool:
    """Return whether a cell is `participant`, in a column that names people if there is one."""
    lines = io.StringIO(text, newline="")
    rows: Iterator[list[str]] = csv.reader(lines)
    if tabs:
        rows = (line.rstrip("\n").split("\t") for line in lines)
    try:
        header = next(rows, [])
        # Only these columns, because a pseudonym that is a number would be found among scores.
        who = {n for n, name in enumerate(header) if name in _WHO} or {*range(len(header))}
        return any(
            # Exports put an apostrophe before what a spreadsheet would take for a formula.
            n in who and cell.removeprefix("'") == participant
            for row in rows
            for n, cell in enumerate(row)
        )
    except csv.Error:  # touchbeam did not write it
        return participant in text


def _mention(participant: str) -> str:
    r"""Return the pattern of `participant` in a text; a number must stand where names do.

    >>> re.findall(_mention("P_1"), r"P_10, xP_1, sub-P_1, P\_1 & 7, P_1/1")
    ['P\\_1', 'P_1']
    >>> re.findall(_mention("7"), '{"score": 7, "subject": "7"} <td>7</td> 7/1')
    ['"7"', '7/1']
    """
    in_latex = participant.replace("_", r"\_")
    forms = {participant, json.dumps(participant)[1:-1], html.escape(participant), in_latex}
    name = f"(?:{'|'.join(map(re.escape, sorted(forms)))})"
    # A bare number stands everywhere in a report.
    if participant.isdecimal():
        return rf'(?m)(?<!=)"{name}["/]|"row">{name}<|^{name} &|(?<![\w./-]){name}/\d'
    return rf"(?<![\w-]){name}(?![\w-])"


def _files(study: Path) -> Iterator[Path]:
    """Yield the files below `study` but its journal, without links, pipes and devices."""
    journal = study / "study.db"
    for place, folders, names in os.walk(study):
        folders.sort()
        for path in (Path(place, name) for name in sorted(names)):
            if path not in {journal, log_of(journal)} and not path.is_symlink() and path.is_file():
                yield path
