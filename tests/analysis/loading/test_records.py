"""Tables that grow by rows, and columns as plain values."""

from datetime import UTC, datetime

import pandas as pd

from analysis.loading.records import AttemptRow, SessionRow, Table, values


def attempt(number: int, score: float | None = None) -> AttemptRow:
    return AttemptRow(
        session_id=0,
        trial_index=number,
        trial_kind="trial",
        condition=None if number % 2 else "voltage",
        attempt=1,
        agrees=None if score is None else True,
        score=score,
        started_utc=None if score is None else datetime(2026, 1, 1, tzinfo=UTC),
    )


def test_rows_keep_their_order_and_types_when_they_are_packed() -> None:
    table = Table(AttemptRow)
    rows = [attempt(number, score=7.5 if number == 5 else None) for number in range(12)]
    for row in rows:
        table.append(row)
        assert table.last is row
        assert table.last_id == row.trial_index
    whole = table.frame()

    class InParts(Table[AttemptRow]):
        ROWS_OF_A_PART = 5

    parted = InParts(AttemptRow)
    for row in rows:
        parted.append(row)
        parted.pack()
    assert parted.last_id == 11
    pd.testing.assert_frame_equal(parted.frame(), whole)


def test_a_table_without_rows_has_its_columns() -> None:
    empty = Table(AttemptRow).frame()
    assert empty.empty
    assert empty["score"].dtype == "float64"
    assert {"session_id", "trial_index", "started_utc"} <= set(empty.columns)


def test_values_are_those_of_the_rows() -> None:
    table = Table(AttemptRow)
    table.append(attempt(0, score=7.0))
    table.append(attempt(1))
    frame = table.frame()
    found = {name: values(frame[name]) for name in ("attempt", "agrees", "score", "condition")}
    assert found == {
        "attempt": [1, 1],
        "agrees": [True, None],
        "score": [7.0, None],
        "condition": ["voltage", None],
    }
    assert [type(value) for value in found["attempt"]] == [int, int]


def test_lists_and_large_numbers_stay_what_they_are() -> None:
    table = Table(SessionRow)
    table.append(
        SessionRow(
            participant="P01",
            session=1,
            session_kind="participant",
            conditions=("voltage", "pressure"),
            seed=10**30,
        )
    )
    frame = table.frame()
    assert values(frame["conditions"]) == [("voltage", "pressure")]
    assert values(frame["seed"]) == [10**30]
