"""Everything that is computed from single trials: sensitivities, laws, and checks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.loading.published import SCALE
from analysis.loading.study_data import StudyData
from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.linear_model import LinearSensitivity, linear_sensitivity
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.sensitivity.predictive_checks import (
    PredictiveCheck,
    checked_ordinal,
    checked_two_stage,
)
from analysis.sensitivity.ratings import Ratings
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from analysis.statistics.ordinal import OrdinalEffects, ordinal_effects_of_trials
from analysis.statistics.ordinal_likelihood import Link
from analysis.statistics.table4 import table4
from analysis.trials.arrays import ScoredTrials, detection_trials, scored_trials
from analysis.trials.contrast_ranges import (
    ContrastRange,
    at_places,
    condition_changes,
    contrast_range,
)
from analysis.trials.contrasts import TrialContrasts, trial_contrasts
from analysis.trials.law_likelihood import LawLikelihood, law_likelihoods
from analysis.trials.law_order import LawOrder, law_order
from analysis.trials.order_as_run import OrderAsRun, order_as_run
from analysis.trials.trial_checks import (
    Discrimination,
    Drift,
    FTest,
    Proportion,
    carry_over,
    discrimination,
    drift,
    order_effect,
    proportion,
)
from analysis.workers import done
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import AT_A_PLACE, CONDITIONS, Change
from device.friction.contrasts import predicted_contrast
from device.friction.laws import LAWS
from protocol.study.study import Study
from protocol.study.study_question import ANSWERS, no_change

LINKS: tuple[Link, ...] = ("probit", "logit")
PROCESSES = 2
"""They fit the models of a large study; each takes some 0.3 GB."""
FEWEST_AT_PLACES = 40
"""Of fewer ratings, gains at places alone would be the prior's rather than the data's."""
_NO_CHANGE = frozenset(map(no_change, ANSWERS))


@dataclass(frozen=True, kw_only=True)
class CatchAnswers:
    """Answers to catch trials (0 V) and to signal trials, pooled and by subject."""

    overall: Discrimination | NotEstimable
    subjects: Mapping[str, Discrimination | NotEstimable]


def catch_answers(trials: pd.DataFrame) -> CatchAnswers:
    """Return how often a change was reported with a signal (hits) and without (false alarms).

    Both rates count the same event, any answer but `same` or `not swapped`: a hit need not be in
    the expected direction, as a false alarm has none. A scored trial whose condition expects no
    change is neither.
    """
    asked = trials[trials["change"].notna()]
    reported = ~asked["change"].isin(_NO_CHANGE)
    signal = asked["trial_kind"].eq("trial") & ~asked["expected"].isin(_NO_CHANGE)
    hits = _counted(reported[signal], asked["participant"])
    alarms = _counted(reported[asked["trial_kind"].eq("catch")], asked["participant"])
    people = len(hits.keys() | alarms.keys())
    return CatchAnswers(
        overall=discrimination(_pooled(hits), _pooled(alarms), people=people),
        subjects={who: discrimination(hits.get(who, (0, 0)), alarms[who]) for who in alarms},
    )


def _counted(
    reported: "pd.Series[bool]", participant: "pd.Series[str]"
) -> dict[str, tuple[int, int]]:
    """Return the number of reported changes and of trials, by participant."""
    counts = reported.groupby(participant, sort=False).agg(["sum", "count"])
    return {who: (told, trials) for who, told, trials in counts.itertuples(name=None)}


def _pooled(counts: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
    return sum(told for told, _ in counts.values()), sum(trials for _, trials in counts.values())


PAPERS_RANKING = "paper's ranking"
_CLAIMED = {"voltage": 1.0, "pressure": -1.0}
"""Section 5.2: voltage is best, touch pressure weakest; of the others it says nothing."""
_UNORDERED = NotEstimable("the order in which the scores were given is not known")


@dataclass(frozen=True, kw_only=True)
class LawScore:
    """A law against the ratings; `predicted` has its mean contrast by condition.

    The paper's own ranking has ranks in place of contrasts and says nothing of persons.
    """

    law: str
    predicted: Mapping[str, float]
    order: LawOrder | NotEstimable
    likelihood: LawLikelihood | NotEstimable


@dataclass(frozen=True, kw_only=True)
class SignalAnswers:
    """How many felt the first signal as expected, and the contrast that each law predicts."""

    felt: Proportion | NotEstimable
    predicted: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class TrialStatistics:
    """The statistics of single trials; `ordinal` is by link, `laws` in a fixed order.

    `place_m2` is M2 of the conditions at a place alone, where there are others too.
    `predictive` has the posterior predictive checks by model; a model that fails is not estimable.
    """

    contrasts: TrialContrasts
    scored: ScoredTrials
    ordinal: Mapping[str, OrdinalEffects | NotEstimable]
    m1: LinearSensitivity | NotEstimable
    m2: OrdinalSensitivity | NotEstimable
    m3: TwoStageSensitivity | NotEstimable
    place_m2: OrdinalSensitivity | NotEstimable
    ranges: tuple[ContrastRange, ...]
    predictive: Mapping[str, PredictiveCheck | NotEstimable]
    laws: tuple[LawScore, ...]
    drift: Drift | NotEstimable
    order: FTest | NotEstimable
    carry_over: FTest | NotEstimable
    as_run: OrderAsRun | NotEstimable
    catch: CatchAnswers
    signal: SignalAnswers

    @property
    def has_repeats(self) -> bool:
        """Whether some subject rated some condition more than once."""
        ratings = self.scored.every.given
        cells = np.stack([ratings.subject, ratings.condition])
        return len(np.unique(cells, axis=1).T) < len(ratings.rating)


def trial_statistics(data: StudyData, study: Study, rig: Calibration = NOMINAL) -> TrialStatistics:
    """Return the statistics of the trials that count, felt on that rig."""
    contrasts = trial_contrasts(study, data.trials, data.touches, rig)
    scored = scored_trials(data, contrasts)
    changes = condition_changes(study, data)
    fits = made(
        {
            "M2": partial(checked_ordinal, scored.ratings),
            "M3": partial(checked_two_stage, detection_trials(data, contrasts, study)),
            **{link: partial(_ordinal, scored, link) for link in LINKS},
            "M2 at places": partial(_place_m2, scored.ratings, changes),
        },
        trials=len(scored.ratings.rating),
    )
    m2, m3 = fits["M2"], fits["M3"]
    ordered = bool((scored.place > 0).any())
    published, rating = data.kinds == ("published",), study.rating
    scale = SCALE if published else (float(rating.minimum), float(rating.maximum))
    return TrialStatistics(
        contrasts=contrasts,
        scored=scored,
        ordinal={link: fits[link] for link in LINKS},
        m1=linear_sensitivity(scored.ratings),
        m2=m2.fit,
        m3=m3.fit,
        predictive={"M2": m2.check, "M3": m3.check},
        place_m2=fits["M2 at places"],
        ranges=tuple(contrast_range(name, change, rig) for name, change in changes.items()),
        laws=_laws(data, scored, scale),
        drift=drift(scored.every, scored.place) if ordered else _UNORDERED,
        order=order_effect(scored.every, scored.place) if ordered else _UNORDERED,
        carry_over=carry_over(scored.every, scored.previous) if ordered else _UNORDERED,
        as_run=order_as_run(data, study),
        catch=catch_answers(data.trials),
        signal=_signal(data.trials, contrasts, rig),
    )


def made(fits: Mapping[str, Callable[[], Any]], trials: int) -> dict[str, Any]:
    """Return the results of fits to `trials` trials, by name: of many, two are made at a time.

    The numbers do not depend on where they are computed. Below `LARGE` trials they are made here:
    to start processes would take longer.
    """
    if trials < LARGE:
        return {name: fit() for name, fit in fits.items()}
    found = dict(done([partial(_named, name, fit) for name, fit in fits.items()], PROCESSES))
    return {name: found[name] for name in fits}


def _named(name: str, fit: Callable[[], Any]) -> tuple[str, Any]:
    return name, fit()


def _place_m2(ratings: Ratings, changes: Mapping[str, Change]) -> OrdinalSensitivity | NotEstimable:
    if {changes[name].kind for name in changes} == {AT_A_PLACE}:
        return NotEstimable("all conditions are at a place")
    chosen = at_places(ratings, changes)
    count = len(chosen.given.rating)
    if count < FEWEST_AT_PLACES:
        return NotEstimable(f"at least {FEWEST_AT_PLACES} ratings there are needed, got {count}")
    return ordinal_sensitivity(chosen)


def _ordinal(scored: ScoredTrials, link: Link) -> OrdinalEffects | NotEstimable:
    given = scored.every.given
    return ordinal_effects_of_trials(
        scores=given.rating,
        subject=given.subject,
        condition=given.condition,
        conditions=given.conditions,
        link=link,
    )


def _laws(data: StudyData, scored: ScoredTrials, scale: Interval) -> tuple[LawScore, ...]:
    found = law_scores(data, scored.ratings, scored.contrasts, scale)
    if not data.table.conditions or not set(_CLAIMED) <= set(data.table.conditions):
        return found
    claimed = np.array([_CLAIMED.get(name, 0.0) for name in data.table.conditions])
    nobody = NotEstimable("the claim ranks conditions and says nothing of single persons")
    observed = table4(data.table).column_means
    return (*found, _law_score(PAPERS_RANKING, data, claimed, observed, nobody))


def law_scores(
    data: StudyData, ratings: Ratings, contrasts: Mapping[str, FloatArray], scale: Interval
) -> tuple[LawScore, ...]:
    """Return how contrasts of these trials, by law, order the conditions and fit the ratings."""
    likelihoods = law_likelihoods(ratings, contrasts, scale)
    observed = table4(data.table).column_means
    counts = np.bincount(ratings.condition, minlength=observed.size)
    found = []
    for law, values in contrasts.items():
        sums = np.bincount(ratings.condition, weights=values, minlength=observed.size)
        means = np.full(observed.size, np.nan)
        np.divide(sums, counts, out=means, where=counts > 0)
        found.append(_law_score(law, data, means, observed, likelihoods[law]))
    return tuple(found)


def _law_score(
    law: str,
    data: StudyData,
    predicted: FloatArray,
    observed: FloatArray,
    likelihood: LawLikelihood | NotEstimable,
) -> LawScore:
    known = ~np.isnan(predicted)
    names = tuple(np.array(data.table.conditions, dtype=object)[known])
    return LawScore(
        law=law,
        predicted=dict(zip(names, predicted[known].tolist(), strict=True)),
        order=law_order(names, predicted[known], observed[known]),
        likelihood=likelihood,
    )


def _signal(trials: pd.DataFrame, contrasts: TrialContrasts, rig: Calibration) -> SignalAnswers:
    answered = trials["trial_kind"].eq("signal") & trials["agrees"].notna()
    agreed = int(trials["agrees"][answered].sum())
    if not answered.any():
        predicted = {law: predicted_contrast(CONDITIONS["signal"], law, rig=rig) for law in LAWS}
    else:
        by_law = contrasts.by_law
        predicted = {law: float(np.mean(values[answered])) for law, values in by_law.items()}
    return SignalAnswers(felt=proportion(agreed, int(answered.sum())), predicted=predicted)
