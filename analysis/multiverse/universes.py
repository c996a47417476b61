"""Analyses of one study under every combination of choices, each computed once."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import pandas as pd

from analysis.estimates import FloatArray, ScoreTable
from analysis.felt.measured_statistics import measured_trials
from analysis.loading.sessions import Sessions, is_scored
from analysis.loading.study_data import NothingToReport, StudyData, study_data
from analysis.statistics.summary import Reading, reading
from analysis.trials.contrasts import BEAM_MODELS, trial_contrasts
from device.friction.changes import LAW, RUNG
from device.friction.laws import LAWS
from device.friction.scenes import NOMINAL, Calibration
from protocol.study.rules import Exclusions
from protocol.study.study import Study

# The choices that an analysis makes, and the options that differ in one study.


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
    # Exclusions live in the tables themselves, so that clearing them there takes all back.
    sessions, every = (it.assign(exclusion=None) for it in (recorded.sessions, attempts))
    nobody = replace(recorded, sessions=sessions, attempts=every)
    judged = recorded.touches[["force_ok", "place_ok", "speed_ok"]]
    slipped = recorded.touches["attempt_id"][judged.eq(False).fillna(False).any(axis=1)]
    slips = attempts["exclusion"].mask(attempts.index.isin(slipped), STRICT)
    # Without `rules`, because these exclude, too.
    whole = study_data(nobody, rehearsals=rehearsals)
    found = {DECIDED: decided}
    if not _same_trials(whole, decided):
        found[NOTHING] = whole
    strictly = replace(recorded, attempts=attempts.assign(exclusion=slips))
    try:
        strict = study_data(strictly, rehearsals=rehearsals, rules=rules)
    # A choice that leaves nobody is no analysis that anybody would report.
    except NothingToReport:
        return found, whole
    if strict.table.given.any() and not any(_same_trials(strict, it) for it in found.values()):
        found[STRICT] = strict
    return found, whole


def _same_trials(one: StudyData, other: StudyData) -> bool:
    same_people = one.table.subjects == other.table.subjects
    return same_people and one.trials.index.equals(other.trials.index)


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


Options = Mapping[Choice, str]
"""The option taken of each choice."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Universe:
    """One analysis: what was chosen, the tests of its table, and contrasts by condition.

    `contrasts` has the mean contrast of the trials that count, of an analysis of the table alone
    none.
    """

    chosen: Options
    reading: Reading
    contrasts: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Universes:
    """All analyses of a study, the report's own first.

    `tables` are those of the table alone, `models` those that compare it with contrasts. `single`
    says of choices with one option why there are no others.
    """

    tables: tuple[Universe, ...]
    models: tuple[Universe, ...]
    single: Mapping[Choice, str]


def universes(
    recorded: Sessions, decided: StudyData, study: Study, rig: Calibration = NOMINAL
) -> Universes:
    """Return the analyses of a study under all choices that differ in it.

    `decided` has those of the recorded sessions that count, as the report takes them; `rig` its
    damping, gain and bodies.
    """
    left_out, whole = exclusions(recorded, decided, study.exclusions)
    # A published table is on the paper's scale, whatever that of the study in the folder.
    least = 0 if decided.kinds == ("published",) else study.rating.minimum
    readings = differing_readings(left_out, least)
    tables = {
        (name, which): Universe(
            chosen={Choice.EXCLUSIONS: name, Choice.READING: READINGS[which].format(least=least)},
            reading=reading(which, table),
            contrasts={},
        )
        for which, by_exclusion in readings.items()
        for name, table in zip(left_out, by_exclusion, strict=True)
    }
    # For all trials at once; each analysis picks those that it counts.
    contrasts = list(_contrasts(whole, study, rig))
    models = tuple(
        Universe(
            chosen={**table.chosen, **options},
            reading=table.reading,
            contrasts=_by_condition(left_out[name], whole, values),
        )
        for options, values in contrasts
        for (name, _), table in tables.items()
    )
    return Universes(
        tables=tuple(tables.values()), models=models, single=_single(left_out, readings, contrasts)
    )


def _single(
    left_out: Mapping[str, StudyData],
    readings: Mapping[str, object],
    contrasts: list[tuple[dict[Choice, str], FloatArray]],
) -> dict[Choice, str]:
    kinds = {options[Choice.CONTRAST] for options, _ in contrasts}
    judged = "nothing was excluded, and no touch that counts was judged to be not as instructed"
    measured = "no friction was measured, and touches as made have the contrasts of those planned"
    alone = {
        Choice.READING: (readings, "no score was withheld, so that the three readings are one"),
        Choice.EXCLUSIONS: (left_out, judged),
        Choice.CONTRAST: (kinds, measured),
    }
    return {choice: why for choice, (options, why) in alone.items() if len(options) == 1}


def _contrasts(
    whole: StudyData, study: Study, rig: Calibration
) -> Iterator[tuple[dict[Choice, str], FloatArray]]:
    """Yield the contrasts of all trials, shape (trials,), by contrast, law and rung."""
    # The report's own options come first: the first of all analyses is then the report's.
    rungs = (RUNG, *(rung for rung in BEAM_MODELS if rung != RUNG))
    laws = (LAW, *(law for law in LAWS if law != LAW))
    known: list[dict[tuple[str, str], FloatArray]] = []
    data = study, whole.trials, whole.touches
    for name in (TOUCHED, PLANNED):
        of_rungs = {
            rung: _where_all(trial_contrasts(*data, rig, rung=rung, as_felt=name == TOUCHED).by_law)
            for rung in rungs
        }
        own = {(law, rung): of_rungs[rung][law] for law in laws for rung in rungs}
        # Touches as made that equal the plan would count every analysis twice.
        if known and all(np.allclose(own[key], known[0][key], equal_nan=True) for key in own):
            continue
        known.append(own)
        for (law, rung), values in own.items():
            yield {Choice.CONTRAST: name, Choice.LAW: law, Choice.RUNG: rung}, values
    if whole.forces:
        yield {Choice.CONTRAST: MEASURED}, measured_trials(*data, whole.forces).value


def _where_all(by_law: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the contrasts of the trials for which each law predicts one, as the report does."""
    known = np.isfinite(list(by_law.values())).all(axis=0)
    return {law: np.where(known, values, np.nan) for law, values in by_law.items()}


def _by_condition(data: StudyData, whole: StudyData, values: FloatArray) -> dict[str, float]:
    """Return the mean contrast of each condition over the scored trials that count."""
    counted = is_scored(data.trials).to_numpy()
    # By index, because analyses leave out different trials.
    own = pd.Series(values, whole.trials.index).reindex(data.trials.index[counted])
    means = own.groupby(data.trials["condition"][counted]).mean().dropna()
    return {name: float(means[name]) for name in data.table.conditions if name in means.index}
