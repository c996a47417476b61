"""Reports and exports in a study's folder that still hold a withdrawn participant."""

import csv
import html
import io
import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

MOST_FILES = 20_000
MOST_BYTES = 512 * 2**20
_TABLES = {".csv", ".tsv"}
_TEXTS = {".json", ".html", ".svg", ".tex", ".md", ".txt"}
_WHO = {"participant", "pseudonym", "subject"}
"""The columns of reports and exports that name a participant."""
_TOPS = ("report.json", "trials.csv", "dataset_description.json")
"""The folder of a report or an export has one of these files."""


@dataclass(frozen=True, kw_only=True)
class OldResults:
    """What still names a participant, relative to the study's folder.

    A report or an export is named by its folder, another file by itself. `unsearched` counts the
    files that are unreadable or beyond the limits of the search.
    """

    holding: tuple[str, ...]
    unsearched: int


def old_results(study: Path, participant: str) -> OldResults:
    """Search the reports and exports in the folder `study` for `participant`; follow no links."""
    holding: dict[str, None] = {}
    unsearched, budget = 0, MOST_BYTES
    for number, path in enumerate(_files(study)):
        try:
            size = path.stat().st_size
            if number >= MOST_FILES or size > budget:
                unsearched += 1
                continue
            budget -= size
            if _names(path, participant):
                holding[str(_result(path, study).relative_to(study))] = None
        except OSError:
            unsearched += 1
    return OldResults(holding=tuple(holding), unsearched=unsearched)


def _result(path: Path, study: Path) -> Path:
    """Return the folder of the report or export that contains `path`, or `path` itself."""
    for folder in path.parents:
        if folder == study:
            break
        if any((folder / top).is_file() for top in _TOPS):
            return folder
    return path


def _names(path: Path, participant: str) -> bool:
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
        who = {n for n, name in enumerate(header) if name in _WHO} or {*range(len(header))}
        return any(
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
    if participant.isdecimal():
        return rf'(?m)(?<!=)"{name}["/]|"row">{name}<|^{name} &|(?<![\w./-]){name}/\d'
    return rf"(?<![\w-]){name}(?![\w-])"


def _files(study: Path) -> Iterator[Path]:
    """Yield the tables and texts below `study`, without links, pipes and devices."""
    for place, folders, names in os.walk(study):
        folders.sort()
        for path in (Path(place, name) for name in sorted(names)):
            if path.suffix in _TEXTS | _TABLES and not path.is_symlink() and path.is_file():
                yield path
