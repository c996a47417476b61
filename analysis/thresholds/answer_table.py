"""Tables of answers in tracks: a row per level, or a row per trial."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from analysis.estimates import Json, plain
from analysis.loading.published import NUMBER, TableError, cell_name, csv_rows, require_commas
from analysis.thresholds.psychometric import Threshold, curve_share, fitted
from protocol.errors import BadInput

MOST_BYTES = 2**26
MOST_ROWS = 1_000_000
MOST_TRIALS = 1_000_000_000
"""Of one row."""
PLACE, TRIALS, CORRECT, LEVEL = ("participant", "track"), "trials", "correct", "level"
LEVEL_VALUE, EXCLUDED = "level_value", "excluded"
"""Of trials that touchbeam recorded, whose column level has the number of a level."""
RIGHT_OR_WRONG: Mapping[str, int] = {"1": 1, "0": 0, "true": 1, "false": 0}

COLUMNS = (
    "participant",
    "track",
    "threshold",
    "95% interval",
    "slope",
    "JND",
    "lapses",
    "p",
    "note",
)
"""Of the table of thresholds that people read."""


@dataclass
class Track:
    """The answers of one participant in one track, an entry per row of the table.

    `left_out` counts recorded trials without a level (catch trials) or an answer, and excluded
    ones.
    """

    participant: str
    track: str
    levels: list[float] = field(default_factory=list)
    trials: list[int] = field(default_factory=list)
    correct: list[int] = field(default_factory=list)
    left_out: int = 0

    def record(self, found: Threshold) -> Json:
        """Return what was found, as `touchbeam fit --json` prints it."""
        told = {"participant": self.participant, "track": self.track, **plain(found)}
        del told["band"], told["likelihood"]  # of a report
        return {**told, "left_out": self.left_out}


def tracks_in(text: str, source: str, shape: str) -> list[Track]:
    """Return the tracks of a table in the order in which they begin.

    The columns participant, track, level, trials and correct may stand in any order, with others
    between them, which are left out. Without the column trials a row is one trial, and correct
    is 1 or 0. In yes-no correct counts "yes".

    Trials that touchbeam recorded have the column level_value, which is taken for the level. Those
    of no track, without a level or an answer, or excluded are left out.

    Args:
        text: of a CSV file, without a byte order mark.
        source: what to call it in messages.
        shape: of the curve that will be fitted: a Weibull curve has no levels below 0.

    Raises:
        TableError: a column is missing or stands twice, a row has another length than the header,
            or a cell breaks its rule; the message gives line, column, value and rule.
    """
    (start, header), *rows = csv_rows(text, source, most=MOST_ROWS, of="rows", do="fit")
    columns = _columns([cell.strip() for cell in header], f"{source}, line {start}")
    if not rows:
        raise TableError(f"{source}: must have a row of answers below the header, got none")
    found: dict[tuple[str, str], Track] = {}
    for line, row in rows:
        where = f"{source}, line {line}"
        if len(row) != len(header):
            raise TableError(
                f"{where}: must have {len(header)} cells as the header, got {len(row)}"
            )
        cells = {name: row[at].strip() for name, at in columns.items()}
        if LEVEL_VALUE in columns and not cells["track"]:
            continue
        participant, name = (_name(cells[name], f"{where}, column {name}") for name in PLACE)
        track = found.setdefault((participant, name), Track(participant, name))
        if LEVEL_VALUE in columns and not _counts_as_answer(cells):
            track.left_out += 1
            continue
        level = LEVEL_VALUE if LEVEL_VALUE in columns else LEVEL
        track.levels.append(_level(cells[level], f"{where}, column {level}", shape))
        trials, correct = _counts(cells, where)
        track.trials.append(trials)
        track.correct.append(correct)
    if not (tracks := [track for track in found.values() if track.levels]):
        raise TableError(f"{source}: must have an answered trial at a level of a track, got none")
    return tracks


def _counts_as_answer(cells: Mapping[str, str]) -> bool:
    """Return whether a recorded trial is one at a level, answered, and not excluded."""
    given = cells[LEVEL_VALUE] and cells[CORRECT]
    return bool(given) and cells.get(EXCLUDED, "no") == "no"


def fits_of(
    tracks: Iterable[Track], source: str, **options: Any
) -> Iterator[tuple[Track, Threshold]]:
    """Yield each track with its fit; `options` are those of `fitted`.

    Raises:
        BadInput: the definition of the threshold is wrong, or the answers of a track, whose the
            message says.
    """
    task = options.get("task", "two intervals")
    curve_share(options.get("threshold_at"), task, options.get("lapse"))
    for track in tracks:
        try:
            yield track, fitted(track.levels, track.trials, track.correct, **options)
        except BadInput as error:
            whose = f"participant {track.participant}, track {track.track}"
            raise BadInput(f"{source}, {whose}: {error}") from None


def _columns(header: Sequence[str], where: str) -> dict[str, int]:
    require_commas(header, where)
    names = [name.casefold() for name in header]
    recorded = (LEVEL_VALUE, EXCLUDED) if LEVEL_VALUE in names else ()
    # Of recorded trials it is the number of the level.
    level = () if recorded else (LEVEL,)
    used = (*PLACE, *level, CORRECT, TRIALS, *recorded)
    for name in used:
        if names.count(name) > 1:
            raise TableError(f"{where}: the column {name} must stand once; rename the others")
        if name not in names and name not in (TRIALS, EXCLUDED):
            raise TableError(
                f"{where}: must have the column {name}; columns are participant, track, level, "
                "trials, correct, or without trials for a row per trial"
            )
    return {name: names.index(name) for name in used if name in names}


def left_out_line(tracks: Iterable[Track]) -> str:
    """Return in words how many rows are not in the fits; nothing if all are."""
    if not (rows := sum(track.left_out for track in tracks)):
        return ""
    were = "row was" if rows == 1 else "rows were"
    return f"{rows} {were} left out: catch trials, not answered, or excluded."


def _name(cell: str, where: str) -> str:
    if not (name := cell_name(cell, where)):
        raise TableError(f"{where}: must have a name, got none; write one in each row")
    return name


def _level(cell: str, where: str, shape: str) -> float:
    if not NUMBER.fullmatch(cell) or abs(float(cell)) > 1e100:
        rule = "a level must be a number from -1e100 to 1e100"
        raise TableError(f"{where}: {rule}, got {cell[:40]!r}")
    if shape == "weibull" and float(cell) < 0:
        raise TableError(
            f"{where}: a level must be at least 0 for the shape weibull, which is a curve of its "
            f"logarithm, got {cell[:40]}; use --shape normal"
        )
    return float(cell)


def _counts(cells: Mapping[str, str], where: str) -> tuple[int, int]:
    """Return the trials and the correct ones of a row."""
    if TRIALS not in cells:
        if (answer := RIGHT_OR_WRONG.get(cells[CORRECT].casefold())) is None:
            raise TableError(
                f"{where}, column {CORRECT}: must be 1 or 0 in a row per trial, got "
                f"{cells[CORRECT][:40]!r}; add the column trials if it is a count"
            )
        return 1, answer
    trials, correct = (_count(cells[name], f"{where}, column {name}") for name in (TRIALS, CORRECT))
    if correct > trials:
        raise TableError(
            f"{where}, column {CORRECT}: must be at most the {trials} trials, got {correct}"
        )
    return trials, correct


def _count(cell: str, where: str) -> int:
    value = float(cell) if NUMBER.fullmatch(cell) else -1.0
    # Spreadsheets and pandas may write a whole number with a point.
    if not 0 <= value <= MOST_TRIALS or value % 1:
        raise TableError(
            f"{where}: must be a whole number from 0 to {MOST_TRIALS}, got {cell[:40]!r}"
        )
    return int(value)


def lines_of(found: Sequence[tuple[Track, Threshold]]) -> Iterator[tuple[str, ...]]:
    """Yield the lines of a table of thresholds for people."""
    yield COLUMNS
    for track, fit in found:
        cells = ["–", "–", "–", "", "–", "–"]
        if not math.isnan(fit.slope):  # as where the levels have no range
            jnd = "" if fit.jnd is None else f"{fit.jnd:.3g}"
            cells[2:] = f"{fit.slope:.3g}", jnd, f"{fit.lapse:.3f}", f"{fit.deviance_p:.2f}"
            cells[0] = fit.reason or f"{fit.threshold:.4g}"
        if fit.reason is None:
            cells[1] = " to ".join(f"{end:.4g}" for end in fit.threshold_ci)
        yield (track.participant, track.track, *cells, "; ".join(fit.flags))
