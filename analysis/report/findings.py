"""Findings of a study: its data and all results computed from them for the report."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import plain
from analysis.felt.measured_statistics import MeasuredStatistics
from analysis.kept import Kept
from analysis.loading.records import values
from analysis.loading.score_table import ScoreTable
from analysis.loading.study_data import StudyData, notes, withheld_beside_scores
from analysis.loading.study_lock import StudyLock
from analysis.multiverse.curve import Multiverse
from analysis.sensitivity.linear_model import own_gains
from analysis.statistics.groups import GroupStatistics, group_statistics
from analysis.statistics.summary import TableStatistics
from analysis.trials.track_fits import Thresholds, thresholds
from analysis.trials.trial_statistics import TrialStatistics
from device.friction.scenes import NOMINAL, Calibration
from protocol.study.participant_texts import scale_in_words
from protocol.study.rules import PAPERS_SCALE, Rating
from protocol.study.study import Study
from protocol.study_file.loading import text_digest


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Command that made the report, and the digest of the study file.

    `broken_chains` names the sessions whose journal was changed after recording; `rig` is the rig
    as it was calibrated. Of a registered study, `rig` is the registered one, `later` a calibration
    made since the sessions, and `unlocked` says what is wrong with the file of the registration.
    `alone` is whether the command named sections, so that nothing is computed for others.
    """

    command: str
    study_sha256: str
    broken_chains: tuple[str, ...] = ()
    rig: Calibration = NOMINAL
    later: Calibration | None = None
    unlocked: str = ""
    alone: bool = False

    def under(self, lock: StudyLock) -> "Origin":
        """Return the origin of the report on a registered study."""
        # A calibration that some session ran under is no news.
        in_force = {run.calibration for run in lock.sessions}
        is_later = self.rig.origin and self.rig.origin not in in_force
        return replace(self, rig=lock.rig, later=self.rig if is_later else None)


def origin_of(
    name: str,
    study_text: str,
    *,
    rehearsals: bool,
    broken: Sequence[str],
    rig: Calibration,
    unlocked: str = "",
    sections: Sequence[str] | None = None,
) -> Origin:
    """Return the origin of a report on the study whose folder has this name.

    `sections` are those that were asked for; a `report.toml` chooses them by itself.
    """
    options = ["--rehearsals"] * rehearsals
    options += [] if sections is None else ["--sections", ",".join(sections)]
    return Origin(
        # Quoted, because a folder's name may have spaces, and the line is there to be run again.
        command=shlex.join(["touchbeam", "report", name, *options]),
        study_sha256=text_digest(study_text),
        broken_chains=tuple(broken),
        rig=rig,
        unlocked=unlocked,
        alone=sections is not None,
    )


class Scale(NamedTuple):
    """Lowest and highest possible score."""

    lowest: float
    highest: float

    @property
    def span(self) -> float:
        """Distance between its ends."""
        return self.highest - self.lowest

    def __str__(self) -> str:
        """Return the ends of the scale."""
        return f"{self.lowest:g} to {self.highest:g}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """Data and results that the sections of a report present.

    `measured` has those of recorded touches, None where nothing was recorded; `multiverse` has the
    study's claims under all choices of analysis, None where they were not asked for.
    """

    title: str
    loaded: StudyData
    study: Study
    origin: Origin
    table: TableStatistics
    trials: TrialStatistics
    measured: MeasuredStatistics | None
    multiverse: Multiverse | None = None
    keep: Kept = field(default_factory=Kept)

    @cached_property
    def trial_records(self) -> list[dict[str, Any]]:
        """A record per trial that counts, with its predicted contrasts and the measured one.

        `touch_measured` says whether the prediction is for force or place as measured.
        """
        contrasts = self.trials.contrasts
        told = _TRIAL | (_TRACK if self.loaded.trials["track"].notna().any() else {})
        trials = zip(*(values(self.loaded.trials[of]) for of in told.values()), strict=True)
        by_law = zip(*(plain(contrast) for contrast in contrasts.by_law.values()), strict=True)
        records = [
            {
                **dict(zip(told, trial, strict=True)),
                "touch_measured": measured,
                "predicted": dict(zip(contrasts.by_law, predicted, strict=True)),
                # The key is there in every study, so that programs need not ask for it.
                "measured": None,
            }
            for trial, measured, predicted in zip(
                trials, contrasts.measured.tolist(), by_law, strict=True
            )
        ]
        if self.measured is None:
            return records
        felt = self.measured.trials
        numbers = zip(records, plain(felt.value), plain(felt.error), felt.why, strict=True)
        return [
            record
            | (
                {"measured": {"contrast": contrast, "error": error}}
                if why is None
                else {"measured_reason": why}
            )
            for record, contrast, error, why in numbers
        ]

    @cached_property
    def groups(self) -> GroupStatistics | None:
        """The comparisons between groups; None of a study without groups."""
        return self.groups_by(self.loaded.table)

    def groups_by(self, table: ScoreTable) -> GroupStatistics | None:
        """Return the comparisons by the scores of a table; gains are those of given scores."""
        known = self.loaded.groups
        rows = [row for row, who in enumerate(table.subjects) if who in known]
        if not rows:
            return None
        names = tuple(dict.fromkeys((*self.study.groups, *known.values())))
        return self.keep(
            group_statistics,
            scores=table.scores[rows],
            gains=own_gains(self.trials.scored.ratings)[rows],
            groups=np.array([names.index(known[table.subjects[row]]) for row in rows]),
            names=names,
            conditions=table.conditions,
        )

    @cached_property
    def thresholds(self) -> Thresholds | None:
        """The thresholds of people in tracks; None of a study without tracks."""
        return thresholds(self.study, self.loaded, self.origin.rig, self.keep)

    @property
    def table_notes(self) -> list[str]:
        """Notes below Table 4."""
        loaded = self.loaded
        return [
            *notes(loaded.table, loaded.empty, self.scale.lowest, self.rating.score_when),
            *withheld_beside_scores(loaded.trials, self.scale.lowest),
        ]

    @property
    def rehearsals(self) -> bool:
        """Whether any of the scores come from a rehearsal."""
        return "rehearsal" in self.loaded.kinds

    @property
    def published(self) -> bool:
        """Whether all scores come from published tables, which come without session records."""
        return self.loaded.kinds == ("published",)

    @property
    def rating(self) -> Rating:
        """Scale of the scores: the study's, or that of published tables if `published`."""
        return PAPERS_SCALE if self.published else self.study.rating

    @property
    def scale(self) -> Scale:
        """The ends of that scale."""
        return Scale(self.rating.minimum, self.rating.maximum)

    @property
    def scale_in_words(self) -> str:
        """That scale with the names of its bands, as the participants read them."""
        return scale_in_words(self.study, self.rating)


_TRIAL = {
    "subject": "participant",
    "session": "session",
    "index": "trial_index",
    "kind": "trial_kind",
    "condition": "condition",
    "level": "level",
    "opposite": "opposite",
    "place": "place",
    "change": "change",
    "agrees": "agrees",
    "score": "score",
    "reaction_s": "reaction_time_s",
}
"""What a trial's record holds, and the column it comes from."""
_TRACK = {name: name for name in ("track", "level_value", "interval", "correct", "reversal")}
"""Likewise where some trials are of tracks, whose `level` is a number of theirs."""
