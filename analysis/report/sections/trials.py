"""All analysed trials, with the contrast that each friction law predicts for them."""

from collections.abc import Mapping, Sequence
from typing import Any

from analysis.loading.sessions import SCORED_KINDS
from analysis.report.blocks import Cell, Column, Row, Section, Table, TableGroup, columns
from analysis.report.findings import Findings
from analysis.report.wording import MISSING, number
from device.friction.changes import RUNG


def section(found: Findings) -> Section:
    """Return a table of trials per subject."""
    return Section(
        name="trials",
        title="Trials",
        blocks=[
            "All analysed trials, with the contrast that each friction law predicts for them "
            f"(rung {RUNG}).",
            TableGroup(name="trial-tables", tables=_subject_tables(found)),
        ],
        data={"trials": found.trial_records},
    )


def trials_anchor(row: int, column: int) -> str:
    """Return the id of the first trial behind a cell of Table 4."""
    return f"trials-{row + 1}-{column + 1}"


def cell_anchor(row: int, column: int) -> str:
    """Return the id of a cell of Table 4."""
    return f"cell-{row + 1}-{column + 1}"


def is_scored(record: Mapping[str, Any]) -> bool:
    """Return whether a trial contributes to Table 4."""
    return record["kind"] in SCORED_KINDS


def _subject_tables(found: Findings) -> list[Table]:
    """Return each subject's trials in the order of the conditions, with unscored trials last."""
    table = found.loaded.table
    places = {name: place for place, name in enumerate(table.conditions)}
    own: dict[str, list[Mapping[str, Any]]] = {name: [] for name in table.subjects}
    for record in found.trial_records:
        own[record["subject"]].append(record)
    predicted = (f"predicted, {law}" for law in found.trials.contrasts.by_law)
    header = [
        *columns("condition", "session", "trial"),
        Column(name="kind", kind="word"),
        Column(name="level"),
        Column(name="answer", kind="word"),
        *columns("as expected", "score", *predicted, "touch"),
    ]
    tables = [(subject, _rows(row, of, places)) for row, (subject, of) in enumerate(own.items())]
    return [
        Table(name="", caption=f"Trials of {subject}", columns=header, rows=rows)
        for subject, rows in tables
    ]


def _rows(
    row: int, records: Sequence[Mapping[str, Any]], places: Mapping[str, int]
) -> Sequence[Row]:
    """Return a subject's trials; cells of Table 4 link to the first one of each condition."""

    def place(record: Mapping[str, Any]) -> int:
        return places[record["condition"]] if is_scored(record) else len(places)

    rows: list[Row] = []
    # Trials that are not scored have no cell of Table 4 to lead back to.
    anchored = {len(places)}
    # Stable: within a condition trials stay in the order of their answers.
    for record in sorted(records, key=place):
        name, *cells = _cells(record)
        column = place(record)
        anchor = "" if column in anchored else trials_anchor(row, column)
        anchored.add(column)
        back = cell_anchor(row, column) if anchor else ""
        label = f"{name}: back to Table 4" if anchor else ""
        rows.append([Cell(text=name, anchor=anchor, target=back, label=label), *cells])
    return rows


def _cells(record: Mapping[str, Any]) -> list[str]:
    kind = f"{record['kind']}, opposite" if record["opposite"] else record["kind"]
    return [
        record["condition"] or MISSING,
        str(record["session"]),
        str(record["index"]),
        kind,
        f"{record['level']:g}",
        record["change"] or MISSING,
        {True: "yes", False: "no", None: MISSING}[record["agrees"]],
        MISSING if record["score"] is None else f"{record['score']:g}",
        *(number(contrast, 4) for contrast in record["predicted"].values()),
        _touch(record),
    ]


def _touch(record: Mapping[str, Any]) -> str:
    """Return the source of the touch for which the contrast is predicted."""
    if record["kind"] == "published":
        return "standard"
    return "measured" if record["touch_measured"] else "as planned"
