"""The record of a simulated study: what the report's tests and estimators make of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, starmap
from math import nan
from typing import NamedTuple

import numpy as np

from analysis.estimates import Estimate, FloatArray, IntArray, NotEstimable, ScoreTable
from analysis.power.answered_cohorts import AnsweredCohort
from analysis.sensitivity.answers_model import answers_model
from analysis.statistics.corrections import holm_of_rows
from analysis.statistics.detection import noticed_p
from analysis.statistics.factorial import SESSION, Crossed, effects_of, factorial_p
from analysis.statistics.groups import CLAIMED, group_statistics
from analysis.statistics.omnibus import omnibus_p
from analysis.statistics.signed_rank import pairwise_signed_ranks
from analysis.statistics.slope import FEWEST_CONDITIONS, own_gains, slope
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import predicted_contrast, trial_change
from protocol.registration.registration import FOLLOWS, GAINS, NOTICED, OMNIBUS, effect_of
from protocol.study.factor import CONDITION
from protocol.study.study import Study

# The names of tests and estimates.

GROUP_SCORE, GROUP_GAIN, BY_GROUP = OF_GROUPS = tuple(CLAIMED.values())
pair_of = "{} - {}".format
between_groups = "{} - {} between groups".format
of_thresholds = "thresholds: {} - {}".format
threshold_in_db = "threshold of {}, dB".format
MEAN_GAIN, LEVELS = "group's gain", "levels"


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the report of a study asks: its tests and estimates by name.

    Without two conditions nothing is asked of responses. `factors` have their levels, sessions of a
    participant among them; `contrasts` is the predicted contrast of each condition as planned, for
    the slope and the gains of groups; with `models` levels and gains are estimated, and gains
    tested for being equal; in an `absolute` study nobody is asked what changed, so that nothing is
    tested of noticing; `tracks` and the pairs of those that are compared have thresholds. People
    of groups that are `alike` are drawn from one population.
    """

    conditions: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    alike: bool = False
    factors: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    contrasts: tuple[float, ...] = ()
    models: bool = False
    absolute: bool = False
    tracks: tuple[str, ...] = ()
    track_pairs: tuple[tuple[str, str], ...] = ()

    @cached_property
    def family(self) -> dict[str, tuple[str, ...]]:
        """Each test that a report claims by one correction over all.

        With it stand the questions of which one must be answered by yes before it counts; a
        question itself waits for none.
        """
        if not self.conditions:
            return {}
        groups = [between_groups(*pair) for pair in combinations(self.groups, 2)]
        of_noticing = {} if self.absolute else self._of_noticing
        in_conditions = [f"{condition}: {pair}" for condition in self.conditions for pair in groups]
        return {
            **dict.fromkeys((OMNIBUS, *[FOLLOWS] * self.is_predicted), ()),
            **dict.fromkeys(self.pairs, (OMNIBUS,)),
            **of_noticing,
            **dict.fromkeys((GROUP_SCORE, GROUP_GAIN, BY_GROUP) if groups else (), ()),
            **dict.fromkeys(groups, (GROUP_SCORE,)),
            **dict.fromkeys(in_conditions, (GROUP_SCORE, BY_GROUP)),
            **{effect_of(*effect): () for effect in effects_of(self.factors)},
        }

    @property
    def _of_noticing(self) -> dict[str, tuple[str, ...]]:
        return {NOTICED: (), **{f"{name} {NOTICED}": (NOTICED,) for name in self.conditions}}

    @property
    def is_predicted(self) -> bool:
        """Whether there are contrasts enough for a slope."""
        return bool(np.isfinite(self.contrasts).sum() >= FEWEST_CONDITIONS)

    @cached_property
    def pairs(self) -> list[str]:
        """Each pair of conditions, as its test is called."""
        return [pair_of(*pair) for pair in combinations(self.conditions, 2)]

    @cached_property
    def tests(self) -> list[str]:
        """All tests; those beside the family count by their own p alone."""
        gains = [GAINS] * bool(self.models and self.conditions)
        return [*self.family, *gains, *starmap(of_thresholds, self.track_pairs)]

    @cached_property
    def estimates(self) -> list[str]:
        """All estimates."""
        of_model = (MEAN_GAIN, LEVELS) if self.models and self.conditions else ()
        return [*of_model, *map(threshold_in_db, self.tracks)]


def asked_by(study: Study, rig: Calibration = NOMINAL, *, models: bool = False) -> Asked:
    """Return what the report of a study asks, with contrasts on that rig."""
    tracks = combinations(study.track, 2)
    of_tracks = Asked(
        tracks=tuple(track.name for track in study.track),
        # Thresholds on different axes cannot be compared.
        track_pairs=tuple((a.name, b.name) for a, b in tracks if a.axis == b.axis),
        models=models,
    )
    if len(study.conditions) < 2:
        return of_tracks
    factors, several = study.factors, study.design.sessions > 1
    if several and not factors:
        factors = {CONDITION: study.conditions}
    sessions = {SESSION: tuple(map(str, range(1, study.design.sessions + 1)))} if several else {}
    changes = (
        trial_change(study, condition.question, condition.expected, condition.touches)
        for condition in study.condition
    )
    contrasts = tuple(predicted_contrast(change, rig=rig) for change in changes)
    return replace(
        of_tracks,
        absolute=study.absolute,
        conditions=study.conditions,
        groups=study.groups,
        factors=factors | sessions,
        contrasts=contrasts,
        # Without a contrast there is no gain.
        models=models and bool(np.isfinite(contrasts).any()),
    )


class Sums(NamedTuple):
    """Sums over the estimates of a kind in one study, such as the levels of its people.

    They are how many there are, their errors, squared errors, whether the 95% intervals hold the
    truth, and the widths of these.
    """

    number: float = 0.0
    error: float = 0.0
    squared: float = 0.0
    covered: float = 0.0
    width: float = 0.0


class Record(NamedTuple):
    """The p of each test of one study and its estimates, as far as there are any, by name.

    Whether gains differ has the probability that they are equal in place of a p. `told` is 1 where
    the gains of people are told, else 0; NaN where nobody asks for them.
    """

    tests: dict[str, float]
    estimates: dict[str, Sums]
    told: float = nan

    def beside(self, other: "Record") -> "Record":
        """Return what there is in either."""
        told = other.told if np.isnan(self.told) else self.told
        return Record(self.tests | other.tests, self.estimates | other.estimates, told)


class Records(NamedTuple):
    """The records of several studies as arrays, in the order of what is asked.

    `p` has shape (studies, tests), NaN where there is no test; `estimates` (studies, estimates, 5);
    `told` (studies,).
    """

    p: FloatArray
    estimates: FloatArray
    told: FloatArray

    @classmethod
    def of(cls, asked: Asked, records: Sequence[Record]) -> "Records":
        """Return the records as arrays."""
        p = [[record.tests.get(name, nan) for name in asked.tests] for record in records]
        sums = [
            [record.estimates.get(name, Sums()) for name in asked.estimates] for record in records
        ]
        return cls(
            np.array(p, dtype=np.float64).reshape(len(records), len(asked.tests)),
            np.array(sums, dtype=np.float64).reshape(len(records), len(asked.estimates), 5),
            np.array([record.told for record in records], dtype=np.float64),
        )

    @classmethod
    def joined(cls, asked: Asked, parts: "Sequence[Records]") -> "Records":
        """Return the records of all parts."""
        return cls(*map(np.concatenate, zip(cls.of(asked, []), *parts, strict=True)))


# Tests of the tables of a study.


def record_of_tables(
    asked: Asked,
    responses: FloatArray,
    noticed: IntArray,
    by_session: FloatArray,
    groups: IntArray,
) -> Record:
    """Return what one study's tables tell, see `analysis.simulation.Tables`.

    Subjects without any response count for nothing, as in the report.
    """
    kept = ~np.isnan(responses).all(axis=1)
    responses, by_session, groups = responses[kept], by_session[kept], groups[kept]
    tests = {} if asked.absolute else _of_noticing(asked, noticed)
    if len(responses):
        subjects = tuple(map(str, range(len(responses))))
        table = ScoreTable(subjects=subjects, conditions=asked.conditions, scores=responses)
        tests |= {OMNIBUS: omnibus_p(table)}
        if asked.is_predicted:
            followed = slope(responses, np.array(asked.contrasts))
            tests |= {} if isinstance(followed, NotEstimable) else {FOLLOWS: followed.p}
        tests |= {
            pair_of(pair.a, pair.b): pair.p_holm
            for pair in pairwise_signed_ranks(table)
            if not isinstance(pair.p_holm, NotEstimable)
        }
        tests |= _of_groups(asked, responses, groups) | _of_factors(asked, responses, by_session)
    return Record(tests, {})


def _of_noticing(asked: Asked, counts: IntArray) -> dict[str, float]:
    """Return p of all conditions and, by Holm's correction, of each; none without catch trials."""
    signal, catch = counts[:, :-1], counts[:, -1]
    if not catch[:, 1].any():
        return {}
    by_condition = signal.transpose(1, 0, 2)
    p = noticed_p(by_condition, np.broadcast_to(catch, by_condition.shape))
    # A condition whose trials expect no change has no test.
    p[by_condition[:, :, 1].sum(axis=1) == 0] = np.nan
    (whole,), (corrected,) = noticed_p(signal.sum(axis=1)[None], catch[None]), holm_of_rows(p[None])
    names = (f"{condition} {NOTICED}" for condition in asked.conditions)
    return {NOTICED: float(whole), **dict(zip(names, corrected.tolist(), strict=True))}


def _of_groups(asked: Asked, responses: FloatArray, groups: IntArray) -> dict[str, float]:
    """Return p of each test of groups that there is."""
    if len(asked.groups) < 2:
        return {}
    contrasts = np.broadcast_to(asked.contrasts, responses.shape)
    given = np.isfinite(contrasts) & np.isfinite(responses)
    gains = own_gains(responses[given], contrasts[given], given.nonzero()[0], len(responses))
    report = group_statistics(responses, gains, groups, asked.groups, asked.conditions)
    questions = {GROUP_SCORE: report.score, GROUP_GAIN: report.gain, BY_GROUP: report.interaction}
    p = {name: test.p for name, test in questions.items() if not isinstance(test, NotEstimable)}
    compared = {"": report.score, **{f"{name}: ": test for name, test in report.conditions.items()}}
    return p | {
        f"{begin}{between_groups(pair.a, pair.b)}": pair.p_holm
        for begin, test in compared.items()
        if not isinstance(test, NotEstimable)
        for pair in test.pairs
    }


def _of_factors(asked: Asked, responses: FloatArray, by_session: FloatArray) -> dict[str, float]:
    """Return p of each effect of factors."""
    if not asked.factors:
        return {}
    within = {name: levels for name, levels in asked.factors.items() if name != SESSION}
    shape = [len(levels) for levels in within.values()]
    crossed = Crossed(factors=within, responses=responses.reshape(-1, *shape))
    wide = Crossed(
        factors=asked.factors, responses=by_session.reshape(-1, *shape, by_session.shape[-1])
    )
    p = factorial_p(crossed, wide if SESSION in asked.factors else None)
    names = (effect_of(*effect) for effect in effects_of(asked.factors))
    return dict(zip(names, p, strict=True))


# Estimates of the model of the answers.


def record_of_answers(cohort: AnsweredCohort, population_gain: float) -> Record:
    """Return what the model of the answers estimates, and the probability of equal gains.

    Levels are at the mean contrast of the cohort; `population_gain` is the true one.
    """
    model = answers_model(cohort.answers)
    if isinstance(stage := model.rating, NotEstimable):
        return Record({}, {}, told=0.0)
    rated, lines = np.flatnonzero(stage.ready.counts), cohort.lines
    levels, at_mean = stage.of_subjects("level"), lines.bias + stage.ready.axes.x_mean * lines.gain
    estimates = {LEVELS: _sums([levels[who] for who in rated], at_mean[rated])}
    told = float(model.untold is None)
    if stage.alone:
        return Record({}, estimates, told)
    estimates[MEAN_GAIN] = _sums([stage.of_group("gain")], np.array([population_gain]))
    return Record({GAINS: stage.equal_gains}, estimates, told)


def _sums(estimates: Sequence[Estimate], truth: FloatArray) -> Sums:
    error = np.array([estimate.value for estimate in estimates]) - truth
    low, high = np.transpose([estimate.interval for estimate in estimates])
    covered = (low <= truth) & (truth <= high)
    parts = (error, error**2, covered, high - low)
    return Sums(len(error), *(float(part.sum()) for part in parts))
