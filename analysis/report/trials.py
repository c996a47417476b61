"""Table 4 whose cells lead to their trials, and those trials with what the model predicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from analysis.loading.missing_scores import LABELS, EmptyCells, marks
from analysis.report.table4_text import table4_lines
from analysis.report.wording import MISSING, number
from analysis.statistics.table4 import Table4


@dataclass(frozen=True, kw_only=True)
class TableCell:
    """A cell of Table 4 and where it leads; no `target` where there is no trial.

    `why` says in words why there is no score, empty where there is one.
    """

    text: str
    target: str = ""
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class TrialLine:
    """A line of a subject's trials; `target` is its id where a cell of Table 4 leads to it."""

    target: str
    cells: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class SubjectTrials:
    """One subject's trials, those of a condition together."""

    subject: str
    lines: Sequence[TrialLine]


def trial_header(laws: Sequence[str]) -> list[str]:
    """Return the header of a subject's trials."""
    asked = ["condition", "session", "trial", "kind", "level", "answer", "as expected", "score"]
    return [*asked, *(f"predicted, {law}" for law in laws), "touch"]


def subject_trials(table: Table4, records: Sequence[Mapping[str, Any]]) -> list[SubjectTrials]:
    """Return each subject's trials in the order of the table's conditions, others at the end."""
    columns = {name: column for column, name in enumerate(table.table.conditions)}
    own: dict[str, list[Mapping[str, Any]]] = {name: [] for name in table.table.subjects}
    for record in records:
        own[record["subject"]].append(record)
    return [
        SubjectTrials(subject=name, lines=_lines(row, mine, columns))
        for row, (name, mine) in enumerate(own.items())
    ]


def _lines(
    row: int, records: list[Mapping[str, Any]], columns: Mapping[str, int]
) -> list[TrialLine]:
    def column(record: Mapping[str, Any]) -> int:
        scored = record["kind"] in {"trial", "published"}
        return columns[record["condition"]] if scored else len(columns)

    lines, before = [], -1
    for record in sorted(records, key=column):
        place = column(record)
        first = place != before and place < len(columns)
        target = cell_name(row, place) if first else ""
        lines.append(TrialLine(target=target, cells=_cells(record)))
        before = place
    return lines


def cell_name(row: int, column: int) -> str:
    """Return the id of a cell's first trial."""
    return f"trials-{row + 1}-{column + 1}"


def _cells(record: Mapping[str, Any]) -> list[str]:
    kind = f"{record['kind']}, opposite" if record["opposite"] else record["kind"]
    agrees = {True: "yes", False: "no", None: MISSING}[record["agrees"]]
    return [
        record["condition"] or MISSING,
        str(record["session"]),
        str(record["index"]),
        kind,
        f"{record['level']:g}",
        record["change"] or MISSING,
        agrees,
        MISSING if record["score"] is None else f"{record['score']:g}",
        *(number(contrast, 4) for contrast in record["predicted"].values()),
        _touch(record),
    ]


def _touch(record: Mapping[str, Any]) -> str:
    """Under what touch the contrast is predicted."""
    if record["kind"] == "published":
        return "standard"
    return "measured" if record["measured"] else "as planned"


def table4_cells(
    table: Table4, trials: Sequence[SubjectTrials], empty: EmptyCells
) -> list[list[TableCell]]:
    """Return the lines of Table 4; each score leads to its trials, each mean to predictions."""
    targets = {line.target for subject in trials for line in subject.lines}
    _, *rows, averages = table4_lines(table, MISSING, marks(empty))
    found = []
    for row, texts in enumerate(rows):
        names = ["", *(cell_name(row, column) for column in range(len(texts) - 2)), ""]
        found.append(
            [
                TableCell(
                    text=text,
                    target=name if name in targets else "",
                    why=LABELS[empty[row, place - 1]] if (row, place - 1) in empty else "",
                )
                for place, (text, name) in enumerate(zip(texts, names, strict=True))
            ]
        )
    leads = ["", *["predictions"] * (len(averages) - 2), ""]
    means = [TableCell(text=text, target=name) for text, name in zip(averages, leads, strict=True)]
    return [*found, means]
