"""The choices that an analysis makes, and the options that differ in one study."""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum

import numpy as np

from analysis.loading.score_table import ScoreTable
from analysis.loading.sessions import Sessions
from analysis.loading.study_data import NothingToReport, StudyData, study_data
from protocol.study.rules import Exclusions


class Choice(StrEnum):
    """A choice that an analysis makes."""

    READING = "reading of missing scores"
    EXCLUSIONS = "exclusions"
    CONTRAST = "contrast"
    LAW = "friction law"
    RUNG = "rung of the model"


READINGS = {"missing": "left missing", "zero": "as {least:g}", "lowest": "as the lowest score"}
"""What the readings of withheld scores are called; `least` is the lowest score of the scale."""
DECIDED, NOTHING, STRICT = "as decided", "nothing excluded", "touches not as instructed, too"
TOUCHED, PLANNED, MEASURED = "predicted, as touched", "predicted, as planned", "measured"


def exclusions(
    recorded: Sessions, decided: StudyData, rules: Exclusions
) -> tuple[dict[str, StudyData], StudyData]:
    """Return the data under each choice of what to leave out, and those of which nothing is.

    They are left out as the operator and the study's `rules` decided; not at all; or with trials,
    too, in which a touch broke the study's rules on force, place or speed. A choice that changes
    nothing, or leaves no score, is absent. Withdrawn participants never count.
    """
    rehearsals, attempts = "rehearsal" in decided.kinds, recorded.attempts
    nobody = replace(
        recorded,
        sessions=recorded.sessions.assign(exclusion=None),
        attempts=attempts.assign(exclusion=None),
    )
    slips = attempts["exclusion"].mask(attempts.index.isin(_slips(recorded)), STRICT)
    whole = study_data(nobody, rehearsals=rehearsals)
    found = {DECIDED: decided}
    if not _same_trials(whole, decided):
        found[NOTHING] = whole
    try:
        strict = study_data(
            replace(recorded, attempts=attempts.assign(exclusion=slips)),
            rehearsals=rehearsals,
            rules=rules,
        )
    except NothingToReport:
        return found, whole
    if strict.table.given.any() and not any(_same_trials(strict, it) for it in found.values()):
        found[STRICT] = strict
    return found, whole


def _slips(recorded: Sessions) -> set[int]:
    """Return the attempts of which a touch was not as instructed."""
    touches = recorded.touches
    slipped = touches[["force_ok", "place_ok", "speed_ok"]].eq(False).fillna(False).any(axis=1)
    return set(touches["attempt_id"][slipped])


def _same_trials(one: StudyData, other: StudyData) -> bool:
    return one.table.subjects == other.table.subjects and one.trials.index.equals(
        other.trials.index
    )


def differing_readings(found: Mapping[str, StudyData], least: float) -> dict[str, list[ScoreTable]]:
    """Return the tables of each choice of what to leave out, by reading of missing scores.

    A reading whose tables are all equal to those of one before it is absent.
    """
    kept: dict[str, list[ScoreTable]] = {}
    for name in READINGS:
        tables = [data.readings(least).get(name, data.table) for data in found.values()]
        if not any(_equal(tables, others) for others in kept.values()):
            kept[name] = tables
    return kept


def _equal(tables: list[ScoreTable], others: list[ScoreTable]) -> bool:
    return all(
        np.array_equal(one.scores, other.scores, equal_nan=True)
        for one, other in zip(tables, others, strict=True)
    )
