"""Claims about the scores of nine people (Section 5.2, Table 4), and the scores themselves."""

import numpy as np

from analysis.claims.claim import Claim, Finding, without_law
from device.mode_shapes import FloatArray

SCORES = np.array(
    [
        [10, 8, 10, 10, 5],
        [10, 10, 10, 8, 7],
        [8, 8, 8, 7, 4],
        [10, 10, 10, 10, 8],
        [8, 8, 10, 8, 5],
        [8, 10, 10, 10, 7],
        [7, 10, 9, 8, 7],
        [7, 8, 10, 7, 8],
        [8, 8, 10, 7, 5],
    ],
    dtype=np.float64,
)
"""Table 4, subjects 1 to 9 in rows."""


COMPREHENSIVE = np.array([8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6])


AVERAGES = np.array([8.44, 8.89, 9.67, 8.33, 6.22])


GRAND_AVERAGE = 8.31


def _rounded(values: FloatArray, printed: FloatArray, digits: int) -> FloatArray:
    """How far values are from what is printed to so many digits."""
    return np.abs(np.round(values + 1e-9, digits) - printed)


def _averages() -> Finding:
    columns, grand = SCORES.mean(axis=0), float(SCORES.mean())
    parts = (_rounded(columns, AVERAGES, 2) < 1e-9).tolist()
    return Finding(
        parts=(*parts, abs(round(grand, 2) - GRAND_AVERAGE) < 1e-9),
        computed={"columns": columns.tolist(), "grand": grand},
    )


def _comprehensive() -> Finding:
    rows = SCORES.mean(axis=1)
    off = _rounded(rows, COMPREHENSIVE, 1)
    return Finding(parts=tuple((off < 1e-9).tolist()), computed={"rows": rows.tolist()})


def _lowest() -> Finding:
    lowest = float(SCORES.mean(axis=1).min())
    return Finding(parts=(abs(lowest - 7.2) < 0.05,), computed={"lowest": lowest})


def _highest() -> Finding:
    highest = float(SCORES.mean(axis=1).max())
    return Finding(parts=(abs(highest - 9.6) < 0.05,), computed={"highest": highest})


def _range() -> Finding:
    rows = SCORES.mean(axis=1)
    low, high = float(rows.min()), float(rows.max())
    return Finding(
        parts=(abs(low - 7) < 0.05, abs(high - 10) < 0.05),
        computed={"lowest": low, "highest": high},
    )


def _third_subject() -> Finding:
    third = SCORES[2]
    return Finding(
        parts=(
            bool(SCORES.mean(axis=1).argmin() == 2),
            bool(third[4] == 4),
            bool(np.isin(third[:4], (7, 8)).all()),
        ),
        computed={"scores": third.tolist()},
    )


CLAIMS = (
    Claim(
        id="table4-averages",
        place="Table 4",
        claim="the conditions' averages are 8.44, 8.89, 9.67, 8.33, 6.22, of all 8.31",
        check="recomputed from the scores, to two decimals",
        expected="8.44, 8.89, 9.67, 8.33, 6.22; 8.31",
        find=without_law(_averages),
        lawless=True,
    ),
    Claim(
        id="table4-comprehensive",
        place="Table 4",
        claim="the comprehensive scores are 8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6",
        check="row means of the scores, to one decimal",
        expected="the printed column",
        find=without_law(_comprehensive),
        lawless=True,
    ),
    Claim(
        id="table4-lowest",
        place="Section 5.2, after Table 4",
        claim="the lowest average score is 7.2",
        check="the smallest row mean",
        expected="7.2",
        find=without_law(_lowest),
        lawless=True,
    ),
    Claim(
        id="table4-highest",
        place="Section 5.2, after Table 4",
        claim="the highest average score is 9.6",
        check="the largest row mean",
        expected="9.6",
        find=without_law(_highest),
        lawless=True,
    ),
    Claim(
        id="table4-range",
        place="Section 5.2, after Table 4",
        claim="comprehensive scores range from 7 to 10",
        check="smallest and largest row mean",
        expected="7 and 10",
        find=without_law(_range),
        lawless=True,
    ),
    Claim(
        id="table4-third-subject",
        place="Section 5.2, after Table 4",
        claim="the third subject scores lowest: 4 for pressure, 7 or 8 elsewhere",
        check="the row of subject 3",
        expected="lowest mean; 4; 7 or 8",
        find=without_law(_third_subject),
        lawless=True,
    ),
)
