"""Everything that is computed from single trials: sensitivities, laws, and checks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from analysis.estimates import LEVEL, FloatArray, NotEstimable
from analysis.loading.response import (
    NO_CHANGE,
    Directions,
    directions,
    mean_responses,
    responses,
)
from analysis.loading.study_data import StudyData, is_papers_table, scale_of_scores
from analysis.sensitivity import laplace
from analysis.sensitivity.answers_model import StudyAnswers, evidence
from analysis.sensitivity.lines import Ratings
from analysis.statistics import corrections
from analysis.statistics.detection import Detection, detection
from analysis.statistics.factorial import (
    SESSION,
    Crossed,
    Factorial,
    factorial_tests,
)
from analysis.statistics.slope import LevelSlope, Slope, level_slope, slope
from analysis.statistics.summary import ConditionTests, condition_tests, table4
from analysis.trials import contrasts as trial_contrasts
from analysis.trials.law_comparison import (
    LawOrder,
    LawScore,
    against_best,
    law_order,
)
from analysis.trials.study_answers import study_answers
from analysis.trials.trial_checks import (
    Discrimination,
    Drift,
    FTest,
    carry_over,
    discrimination,
    drift,
    order_effect,
)
from analysis.workers import done
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import LAW
from device.friction.surfaces import BeamSurface
from protocol.study.factor import CONDITION
from protocol.study.study import Study

PROCESSES = 2
"""They fit the model of a large study, which takes 0.5 GB of 1,000 people."""
_NO_CHANGE = frozenset(NO_CHANGE.values())
_Told = tuple[int, int]
"""Numbers of reported changes and of trials."""
_Check = TypeVar("_Check", FTest, Drift)


@dataclass(frozen=True, kw_only=True)
class CatchAnswers:
    """Answers to catch trials (0 V) and to signal trials, pooled and by subject."""

    overall: Discrimination | NotEstimable
    subjects: Mapping[str, Discrimination | NotEstimable]


def catch_answers(trials: pd.DataFrame) -> CatchAnswers:
    """Return how often a change was reported with a signal (hits) and without (false alarms)."""
    signal, catch = _signal_and_catch(trials)
    hits, alarms = (_counted(trials).get((), {}) for trials in (signal, catch))
    people = len(hits.keys() | alarms.keys())
    return CatchAnswers(
        overall=discrimination(_pooled(hits), _pooled(alarms), people=people),
        subjects={who: discrimination(hits.get(who, (0, 0)), alarms[who]) for who in alarms},
    )


def _signal_and_catch(trials: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the trials with a signal and the catch trials; `reported` is whether a change was.

    Both count the same event, any answer but `same` or `not swapped`: a hit need not be in the
    expected direction, as a false alarm has none. A scored trial whose condition expects no
    change is neither.
    """
    asked = trials[trials["change"].notna()]
    asked = asked.assign(reported=~asked["change"].isin(_NO_CHANGE))
    signal = asked["trial_kind"].eq("trial") & ~asked["expected"].isin(_NO_CHANGE)
    return asked[signal], asked[asked["trial_kind"].eq("catch")]


def _counted(trials: pd.DataFrame, *names: str) -> dict[tuple[Any, ...], dict[str, _Told]]:
    """Return each participant's reported changes and trials, by what the columns `names` say."""
    found: dict[tuple[Any, ...], dict[str, _Told]] = {}
    known = trials.dropna(subset=[*names])
    columns = (known[name].tolist() for name in (*names, "participant", "reported"))
    for *key, who, reported in zip(*columns, strict=True):
        own = found.setdefault(tuple(key), {})
        told, asked = own.get(who, (0, 0))
        own[who] = told + reported, asked + 1
    return found


def _pooled(counts: Mapping[str, _Told]) -> _Told:
    return sum(told for told, _ in counts.values()), sum(trials for _, trials in counts.values())


OF_PEOPLE = ("participant", "group")
"""Columns that tell people apart, so that they choose the catch trials, too."""


@dataclass(frozen=True, kw_only=True)
class Detected:
    """How well a change was noticed in some trials.

    `of` says in which, by the name of a column: empty for all. `p_holm` is corrected over the
    conditions, None in trials that are no condition's.
    """

    of: Mapping[str, Any]
    found: Detection | NotEstimable
    p_holm: float | None = None

    @property
    def noticed(self) -> bool:
        """Whether more changes were reported than on catch trials, corrected over conditions."""
        return self.p_holm is not None and self.p_holm < LEVEL


def detected_by(trials: pd.DataFrame, *names: str) -> tuple[Detected, ...]:
    """Return what was noticed in each part of the trials with a signal, as the columns part them.

    The catch trials beside it are those of the same people.
    """
    signal, catch = _signal_and_catch(trials)
    hits = _counted(signal, *names) if names else {(): _counted(signal).get((), {})}
    alarms = _counted(catch, *(name for name in names if name in OF_PEOPLE))
    made = []
    for key, own in hits.items():
        of: dict[str, Any] = dict(zip(names, key, strict=True))
        beside = alarms.get(tuple(of[name] for name in names if name in OF_PEOPLE), {})
        people = dict.fromkeys([*own, *beside])
        counts = (tuple(told.get(who, (0, 0)) for who in people) for told in (own, beside))
        made.append(Detected(of=of, found=_detection(*counts)))
    return tuple(made)


# Of 1,000 people there are few who have not the same counts as somebody else.
@lru_cache(maxsize=1024)
def _detection(hits: tuple[_Told, ...], alarms: tuple[_Told, ...]) -> Detection | NotEstimable:
    return detection(*np.array([hits, alarms], np.int64).reshape(2, -1, 2))


PAPERS_RANKING = "paper's ranking"
_CLAIMED = {"voltage": 1.0, "pressure": -1.0}
"""Section 5.2: voltage is best, touch pressure weakest; of the others it says nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrialStatistics:
    """The statistics of the trials that count, felt on that rig; each is computed when it is asked.

    `laws` are in a fixed order.
    """

    data: StudyData
    study: Study
    rig: Calibration = NOMINAL

    @property
    def has_laws(self) -> bool:
        """Whether contrasts differ by law, as they do where a beam is modelled."""
        return isinstance(self.rig.surface, BeamSurface)

    @cached_property
    def scored(self) -> trial_contrasts.ScoredTrials:
        """The trials that count for the table of scores."""
        return trial_contrasts.scored_trials(self.data, self.contrasts)

    @cached_property
    def contrasts(self) -> trial_contrasts.TrialContrasts:
        """Contrasts of all trials, by law."""
        data = self.data
        return trial_contrasts.trial_contrasts(self.study, data.trials, data.touches, self.rig)

    @cached_property
    def responses(self) -> FloatArray:
        """The response of each trial, shape (trials,)."""
        return responses(self.data.trials, float(self.study.rating.minimum))

    @cached_property
    def response_tests(self) -> ConditionTests:
        """The tests of the conditions, on mean responses."""
        table = self.data.table
        means = mean_responses(self.data.trials, self.responses, table.subjects, table.conditions)
        return condition_tests(means)

    @cached_property
    def answered(self) -> Ratings:
        """The predicted trials with their responses in place of ratings."""
        contrast = self.contrasts.by_law[LAW]
        chosen = np.isfinite(self.responses) & np.isfinite(contrast)
        trials = trial_contrasts.ratings_of(self.data, self.data.trials[chosen], contrast[chosen])
        return replace(trials, rating=self.responses[chosen])

    # Checks of the order and the place of trials; scores of a published table have none.
    @cached_property
    def order_effect(self) -> FTest | NotEstimable:
        """Whether ratings depend on the place in the session."""
        return self._in_order(lambda of: order_effect(of.every, of.place))

    @cached_property
    def carry_over(self) -> FTest | NotEstimable:
        """Whether they depend on the condition before."""
        return self._in_order(lambda of: carry_over(of.every, of.previous))

    @cached_property
    def drift(self) -> Drift | NotEstimable:
        """How they move with the place in the session."""
        return self._in_order(lambda of: drift(of.every, of.place))

    def _in_order(
        self, check: Callable[[trial_contrasts.ScoredTrials], _Check | NotEstimable]
    ) -> _Check | NotEstimable:
        if not (self.scored.place > 0).any():
            return NotEstimable("the order in which the scores were given is not known")
        return check(self.scored)

    @cached_property
    def directions(self) -> Mapping[str, Directions]:
        """How the changes of each condition were answered; nothing where nobody was asked."""
        by_name = directions(self.data.trials, "condition")
        names = self.data.table.conditions
        return {name: by_name[name,] for name in names if (name,) in by_name}

    @cached_property
    def predicted(self) -> FloatArray:
        """The mean predicted contrast of each condition, shape (conditions,), NaN without one."""
        by_law = {LAW: self.scored.contrasts[LAW]}
        return mean_contrasts(self.data, self.scored.ratings, by_law)[LAW]

    @cached_property
    def slope(self) -> Slope | NotEstimable:
        """Whether mean responses follow the conditions' mean predicted contrasts."""
        return slope(self.response_tests.table.scores, self.predicted)

    @cached_property
    def level_slope(self) -> LevelSlope | NotEstimable | None:
        """The same within conditions; None where none has several levels."""
        levels = self.data.scored.groupby("condition")["level"].nunique()
        several = levels.reindex(self.data.table.conditions, fill_value=0).to_numpy() > 1
        if not several.any():
            return None
        # Of one level alone contrasts differ by what was measured of each touch.
        trials = self.answered.where(several[self.answered.condition])
        return level_slope(trials.rating, trials.contrast, trials.subject, trials.condition)

    @cached_property
    def ranges(self) -> tuple[trial_contrasts.ContrastRange, ...]:
        """How certain the contrast of each condition is, where a beam's model predicts it."""
        if not self.has_laws:
            return ()
        changes = trial_contrasts.condition_changes(self.study, self.data).items()
        return tuple(trial_contrasts.contrast_range(*each, self.rig) for each in changes)

    @cached_property
    def crossed(self) -> tuple[Crossed, Crossed | None] | None:
        """Responses by factor, and by session beside them where there are several; or None."""
        return crossed_responses(self.study, self.data, self.responses)

    @cached_property
    def factorial(self) -> Factorial | None:
        """Effects of the factors and of the session; None of a study without both."""
        if self.crossed is None:
            return None
        answers = {
            of: numbers
            for crossed in self.crossed
            if crossed is not None
            for of, numbers in level_answers(self.study, self.data, crossed).items()
        }
        return factorial_tests(*self.crossed, answers=answers)

    @cached_property
    def laws(self) -> tuple[LawScore, ...]:
        """Each law, and the paper's own ranking, against the ratings."""
        factors = against_best(self.evidence)
        return tuple(
            LawScore(
                law=law,
                predicted=dict(zip(means.conditions, means.predicted.tolist(), strict=True)),
                order=self.orders[law],
                log_evidence=self.evidence[law],
                ln_bayes_factor=factors[law],
            )
            for law, means in self._means.items()
        )

    @cached_property
    def evidence(self) -> Mapping[str, float | NotEstimable]:
        """Log evidence of the answers under each law's contrasts, all of the same trials."""
        if not self.has_laws:
            return {LAW: NotEstimable("these contrasts are the same under all laws")}
        by_law = self.contrasts.by_law
        known = np.isfinite([*by_law.values()]).all(axis=0)
        # Processes import what a call names, so that none names a module with data frames.
        calls = [
            partial(_evidence, law, self.answers(np.where(known, contrast, np.nan)))
            for law, contrast in by_law.items()
        ]
        is_large = len(self.data.trials) >= laplace.LARGE
        found = dict(done(calls, PROCESSES) if is_large else (call() for call in calls))
        in_order = {law: found[law] for law in by_law}
        return {**in_order, PAPERS_RANKING: NotEstimable("the claim predicts no contrasts")}

    def answers(self, contrast: FloatArray) -> StudyAnswers:
        """Return the answers of the trials with these contrasts, shape (trials,), NaN for none."""
        rating = scale_of_scores(self.study, self.data.kinds)
        return study_answers(self.study, self.data, contrast, rating)

    @cached_property
    def orders(self) -> Mapping[str, LawOrder | NotEstimable]:
        """How each law orders the conditions, by law; what `laws` says of it, without its fit."""
        return {law: law_order(*means) for law, means in self._means.items()}

    def orders_of_scores(self) -> Mapping[str, LawOrder | NotEstimable]:
        """The same of the mean scores that were given, as earlier versions had it."""
        means = self._means_of(table4(self.data.table).column_means)
        return {law: law_order(*each) for law, each in means.items()}

    @cached_property
    def _means(self) -> Mapping[str, "MeanContrasts"]:
        return self._means_of(self.response_tests.means)

    def _means_of(self, observed: FloatArray) -> Mapping[str, "MeanContrasts"]:
        by_law = mean_contrasts(self.data, self.scored.ratings, self.scored.contrasts)
        if not self.has_laws:  # there are none to compare
            by_law = {LAW: by_law[LAW]}
        elif is_papers_table(self.study, self.data.table):
            ranking = [_CLAIMED.get(name, 0.0) for name in self.data.table.conditions]
            by_law = {**by_law, PAPERS_RANKING: np.array(ranking)}
        names = self.data.table.conditions
        return {law: of_conditions(names, means, observed) for law, means in by_law.items()}

    @cached_property
    def noticed(self) -> tuple[Detected, ...]:
        """What was noticed of each condition, and then of all; nothing without catch trials."""
        trials = self.data.of_noticing
        asked = trials["change"].notna()
        if not (asked & trials["trial_kind"].eq("catch")).any():
            return ()
        by_name = {each.of["condition"]: each for each in detected_by(trials, "condition")}
        names = [name for name in self.data.table.conditions if name in by_name]
        found = [by_name[name] for name in names]
        p = [at.p if isinstance(at := each.found, Detection) else np.nan for each in found]
        corrected = zip(found, corrections.holm(p), strict=True)
        return (
            *(replace(each, p_holm=None if np.isnan(p) else p) for each, p in corrected),
            *detected_by(trials),
        )


def _evidence(law: str, answers: StudyAnswers) -> tuple[str, float | NotEstimable]:
    return law, evidence(answers)


def crossed_responses(
    study: Study, data: StudyData, responses: FloatArray
) -> tuple[Crossed, Crossed | None] | None:
    """Return mean responses by factor, and those by session as well.

    A condition that the study file no longer has is in no cell. The conditions of a study without
    factors are one where there are several sessions. `responses` are those of `data.trials`.
    """
    sessions = sorted(data.scored["session"].unique())
    is_papers = data.kinds == ("published",) and not study.imported
    if is_papers or not (study.factors or len(sessions) > 1):
        return None
    names, factors = _cells(study, data)
    shape = [len(levels) for levels in factors.values()]
    people = data.table.subjects
    trials = data.trials.assign(response=responses)
    over = mean_responses(trials, responses, people, names).scores.reshape(-1, *shape)
    crossed = Crossed(factors=factors, responses=over)
    if len(sessions) < 2:
        return crossed, None
    means = trials.groupby(["participant", "condition", "session"])["response"].mean()
    cells = pd.MultiIndex.from_product([people, names, sessions])
    return crossed, Crossed(
        factors={**factors, SESSION: tuple(map(str, sessions))},
        responses=means.reindex(cells).to_numpy().reshape(-1, *shape, len(sessions)),
    )


def level_answers(
    study: Study, data: StudyData, crossed: Crossed
) -> dict[tuple[str, str], tuple[float, float]]:
    """Return by factor and level the share of answers as expected, and their mean score.

    They are of the people in the tests: those who answered in every cell of `crossed`. Where that
    is by session, they are of the sessions alone.
    """
    names, factors = _cells(study, data)
    people = np.array(data.table.subjects, dtype=object)[crossed.are_complete]
    is_tested = data.scored["participant"].isin(people) & data.scored["condition"].isin(names)
    asked = data.scored[is_tested & data.scored["agrees"].notna()]
    if SESSION in crossed.factors:
        of = {SESSION: asked["session"].astype(str).to_numpy()}
    else:
        places = np.unravel_index(
            pd.Index(names).get_indexer(pd.Index(asked["condition"])),
            [len(levels) for levels in factors.values()] or [1],
        )
        of = {name: np.array(factors[name])[at] for name, at in zip(factors, places, strict=False)}
    agrees = asked["agrees"].astype(bool)
    score = asked["score"].where(agrees)
    return {
        (name, level): (float(agrees[at == level].mean()), float(score[at == level].mean()))
        for name, at in of.items()
        for level in crossed.factors[name]
    }


def _cells(study: Study, data: StudyData) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]]]:
    """Return the conditions in the order of their cells, and the levels of each factor."""
    if study.factors:
        return study.conditions, study.factors
    names = data.table.conditions
    # A single condition is no factor.
    return names, {CONDITION: names} if len(names) > 1 else {}


class MeanContrasts(NamedTuple):
    """Mean predicted contrast and mean response of the conditions that have a prediction."""

    conditions: tuple[str, ...]
    predicted: FloatArray
    observed: FloatArray


def mean_contrasts(
    data: StudyData, ratings: Ratings, contrasts: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return the mean contrast of each condition, (conditions,), by law; NaN without any."""
    counts = np.bincount(ratings.condition, minlength=len(data.table.conditions))
    some = np.where(counts > 0, counts, np.nan)
    return {
        law: np.bincount(ratings.condition, values, len(counts)) / some
        for law, values in contrasts.items()
    }


def of_conditions(
    conditions: Sequence[str], predicted: FloatArray, observed: FloatArray
) -> MeanContrasts:
    """Return contrasts and means of the conditions that have a prediction."""
    known = ~np.isnan(predicted)
    names = tuple(name for name, has in zip(conditions, known, strict=True) if has)
    return MeanContrasts(names, predicted[known], observed[known])
