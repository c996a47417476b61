"""Specification curve of a claim: all its analyses by effect, and the choice that moves it most.

Simonsohn, Simmons and Nelson, Nature Human Behaviour 4, 2020.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations, product

import numpy as np

from analysis.estimates import LEVEL, FloatArray, Interval, Json, NotEstimable, plain
from analysis.loading.sessions import Sessions
from analysis.loading.study_data import StudyData
from analysis.multiverse.universes import Choice, Options, Universe, universes
from analysis.statistics import intervals, omnibus, summary
from analysis.trials.law_likelihood import law_order
from device.friction.changes import CONDITIONS
from device.friction.scenes import NOMINAL, Calibration
from protocol.study.study import Study

# Claims about people that each analysis of a table of scores can judge.


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What one analysis says of a claim; the effect is positive where it is the claimed one."""

    effect: float
    p: float
    interval: Interval | None = None

    @property
    def significant(self) -> bool:
        """Whether the effect is the claimed one, p < .05."""
        return self.effect > 0 and self.p < LEVEL


@dataclass(frozen=True, kw_only=True)
class PeopleClaim:
    """A claim about people.

    `effect` is what `judge` measures, with its unit; `of_model` whether the claim compares ratings
    with contrasts; `signed` whether the effect has a sign, so that an analysis can contradict the
    claim: one without a sign supports it where p < .05.
    """

    id: str
    words: str
    effect: str
    judge: Callable[[Universe], Judged | NotEstimable]
    of_model: bool = False
    signed: bool = True

    def supported(self, found: Judged) -> bool:
        """Return whether an analysis supports the claim."""
        return found.effect > 0 if self.signed else found.significant


def above(name: str, words: str, pairs: Iterable[tuple[str, str]]) -> PeopleClaim:
    """Return the claim that the first condition of each pair is rated above the second.

    Its effect is the least mean difference; p is the largest of the signed rank tests after Holm's
    correction over all pairs of conditions, as all of them must hold.
    """
    judge = partial(_above, tuple(pairs))
    return PeopleClaim(id=name, words=words, effect="least mean difference, points", judge=judge)


def _differ(universe: Universe) -> Judged | NotEstimable:
    """Judge whether conditions differ, by Friedman's test or that of Skillings and Mack.

    W is the statistic over Σ(kᵢ - 1), which it cannot exceed, where subject i gave kᵢ scores; with
    no score missing it is Kendall's.
    """
    if isinstance(test := universe.reading.omnibus, NotEstimable):
        return test
    if isinstance(test, omnibus.Friedman):
        ends = test.kendall_w_interval
        known = None if isinstance(ends, NotEstimable) else ends
        return Judged(effect=test.kendall_w, p=test.best_p, interval=known)
    counts = universe.reading.table4.table.given.sum(axis=1)
    # A subject with one score ranks nothing.
    most = float(np.maximum(counts - 1, 0).sum())
    return Judged(effect=test.statistic / most, p=test.best_p)


def _above(pairs: tuple[tuple[str, str], ...], universe: Universe) -> Judged | NotEstimable:
    found = []
    for pair in pairs:
        differences = pair_differences(universe.reading, *pair)
        if not differences.size:
            return NotEstimable(f"nobody scored both {' and '.join(pair)}")
        found.append((float(differences.mean()), intervals.mean_interval(differences)))
    # All pairs must hold, so that the claim is as weak as the weakest.
    effect, ends = min(found, key=lambda each: each[0])
    weakest = max(pair_p(universe.reading, *pair) for pair in pairs)
    interval = None if isinstance(ends, NotEstimable) else ends
    return Judged(effect=effect, p=weakest, interval=interval)


def pair_differences(reading: summary.Reading, one: str, other: str) -> FloatArray:
    """Return the differences of two conditions' scores, of the subjects who have both."""
    table = reading.table4.table
    first, second = (table.scores[:, table.conditions.index(name)] for name in (one, other))
    both = ~np.isnan(first - second)
    return np.asarray((first - second)[both])


def pair_p(reading: summary.Reading, one: str, other: str) -> float:
    """Return p of a pair of conditions after Holm's correction; 1 without any difference."""
    test = next(pair for pair in reading.pairwise if {pair.a, pair.b} == {one, other})
    # Equal scores do not support that one is above the other.
    return 1.0 if isinstance(test.p_holm, NotEstimable) else test.p_holm


def _follows(universe: Universe) -> Judged | NotEstimable:
    means, contrasts = universe.reading.table4, universe.contrasts
    rated = dict(zip(means.table.conditions, means.column_means.tolist(), strict=True))
    predicted = np.array(list(contrasts.values()))
    found = law_order(tuple(contrasts), predicted, np.array([rated[name] for name in contrasts]))
    if isinstance(found, NotEstimable):
        return found
    if isinstance(found.spearman, NotEstimable) or isinstance(found.p, NotEstimable):
        return NotEstimable("all contrasts, or all mean ratings, are equal")
    return Judged(effect=found.spearman, p=found.p)


_DIFFER = PeopleClaim(
    id="conditions-differ",
    words="The conditions differ",
    effect="agreement of subjects (Kendall's W)",
    judge=_differ,
    signed=False,
)
_LEAD = "Voltage and structure are rated above all other conditions"
_RANKED = (
    ("voltage-best", "Voltage is rated above every other condition", ("voltage",), "above"),
    ("pressure-weakest", "Pressure is rated below every other condition", ("pressure",), "below"),
    ("structure-and-voltage-lead", _LEAD, ("voltage", "structure"), "above"),
)
"""What the paper found to be felt most and least (Section 5.2, abstract): which conditions were
rated above, or below, all others."""
_FOLLOW = PeopleClaim(
    id="order-follows-model",
    words="Mean ratings follow the order that the model predicts",
    effect="Spearman's ρ over conditions",
    judge=_follows,
    of_model=True,
)
NAMES = (_DIFFER.id, *(name for name, *_ in _RANKED), _FOLLOW.id)
"""Short names of the claims that are judged in each study that has their conditions."""


def named_claims(conditions: Sequence[str]) -> list[PeopleClaim]:
    """Return those of the paper's claims that a table with these conditions can judge."""
    # The paper claims nothing about conditions of other names.
    known = [name for name in conditions if name in CONDITIONS]
    ranked = []
    for name, words, named, side in _RANKED:
        others = [other for other in known if other not in named]
        if set(named) <= set(known) and others:
            pairs = product(named, others) if side == "above" else product(others, named)
            ranked.append(above(name, words, pairs))
    return [_DIFFER, *ranked, _FOLLOW]


_EQUAL = 1e-9
"""Effects that differ by less do so by rounding error."""


@dataclass(frozen=True, kw_only=True)
class Tally:
    """How many analyses there are, support a claim, and do so with p < .05; their mean effect."""

    analyses: int
    supported: int
    significant: int
    mean_effect: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A claim in all analyses that can judge it, from the smallest effect to the largest.

    `own` is the place of the report's own analysis, None if that cannot judge it; `options` has
    those of each choice that has several; `unjudged` counts the analyses that cannot, by reason.
    """

    claim: PeopleClaim
    options: Mapping[Choice, tuple[str, ...]]
    chosen: tuple[Options, ...]
    judged: tuple[Judged, ...]
    own: int | None
    unjudged: Mapping[str, int]

    @property
    def tally(self) -> Tally:
        """Of all analyses."""
        return self._tally(self.judged)

    def by_option(self, choice: Choice) -> dict[str, Tally]:
        """Return how the analyses with each option of a choice judge the claim."""
        both = list(zip(self.chosen, self.judged, strict=True))
        return {
            option: self._tally([it for chosen, it in both if chosen.get(choice) == option])
            for option in self.options[choice]
        }

    def _tally(self, judged: Sequence[Judged]) -> Tally:
        return Tally(
            analyses=len(judged),
            supported=sum(map(self.claim.supported, judged)),
            significant=sum(each.significant for each in judged),
            mean_effect=float(np.mean([each.effect for each in judged])) if judged else np.nan,
        )

    @cached_property
    def moves(self) -> dict[Choice, float]:
        """By how much the mean effect differs between the options of each choice."""
        found = {}
        for choice in self.options:
            means = [each.mean_effect for each in self.by_option(choice).values()]
            found[choice] = max(means) - min(means)
        return found

    @property
    def moves_most(self) -> Choice | None:
        """The choice that moves the effect most, None if none does."""
        moving = {choice: by for choice, by in self.moves.items() if by > _EQUAL}
        return max(moving, key=moving.__getitem__, default=None)

    @property
    def decides(self) -> Choice | None:
        """The choice that alone decides the verdicts, which are not all the same; None if none.

        A verdict is whether the claim is supported, and whether with p < .05.
        """
        for choice in self.options:
            tallies = self.by_option(choice).values()
            # A choice decides if each of its options gives one verdict throughout, and not all the
            # same.
            counts = [(it.supported / it.analyses, it.significant / it.analyses) for it in tallies]
            if {share for both in counts for share in both} <= {0.0, 1.0} and len(set(counts)) > 1:
                return choice
        return None


@dataclass(frozen=True, kw_only=True)
class PairTally:
    """In how many analyses one condition is rated above another, and with p < .05 after Holm."""

    above: str
    below: str
    analyses: int
    supported: int
    significant: int
    least: float
    largest: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Multiverse:
    """Claims and pairs of conditions in all analyses of a study.

    `single` says of the choices with one option why there are no others.
    """

    curves: tuple[Curve, ...]
    pairs: tuple[PairTally, ...]
    single: Mapping[Choice, str]

    def as_json(self) -> Json:
        """Return everything as JSON; `own` is the place of the report's analysis, from 0."""
        return {
            "single": plain(self.single),
            "claims": [_curve_json(curve) for curve in self.curves],
            "pairs": plain(self.pairs),
        }


def multiverse(
    recorded: Sessions,
    decided: StudyData,
    study: Study,
    rig: Calibration = NOMINAL,
    claims: Sequence[PeopleClaim] | None = None,
) -> Multiverse:
    """Return claims in all analyses of a study; by default those of the paper that it can judge."""
    found = universes(recorded, decided, study, rig)
    judged = named_claims(decided.table.conditions) if claims is None else claims
    curves = [curve(it, found.models if it.of_model else found.tables) for it in judged]
    return Multiverse(
        curves=tuple(each for each in curves if each.judged),
        pairs=tuple(_pairs(found.tables)),
        single=found.single,
    )


def curve(claim: PeopleClaim, analyses: Sequence[Universe]) -> Curve:
    """Return the curve of a claim; the first of the analyses is the report's own."""
    # A law that predicts nothing has no order to follow.
    able = [it for it in analyses if it.contrasts or not claim.of_model]
    found = [(universe.chosen, claim.judge(universe)) for universe in able]
    known = [(chosen, it) for chosen, it in found if isinstance(it, Judged)]
    options = {
        choice: tuple(dict.fromkeys(chosen[choice] for chosen, _ in known if choice in chosen))
        for choice in Choice
    }
    known.sort(key=lambda each: each[1].effect)
    # By identity, because sorting by effect has moved it.
    own = [place for place, (chosen, _) in enumerate(known) if chosen is analyses[0].chosen]
    return Curve(
        claim=claim,
        options={choice: names for choice, names in options.items() if len(names) > 1},
        chosen=tuple(chosen for chosen, _ in known),
        judged=tuple(it for _, it in known),
        own=own[0] if own else None,
        unjudged=Counter(it.reason for _, it in found if isinstance(it, NotEstimable)),
    )


def _pairs(tables: Sequence[Universe]) -> list[PairTally]:
    """Return each pair of conditions, the first the one that most analyses rate above the other."""
    readings = [universe.reading for universe in tables]
    found = []
    for pair in combinations(readings[0].table4.table.conditions, 2):
        judged = [
            (float(differences.mean()), pair_p(it, *pair))
            for it in readings
            if (differences := pair_differences(it, *pair)).size
        ]
        if not judged:
            continue
        # The pair is named after what most analyses say, not after the order of the columns.
        sign = -1 if sum(np.sign(effect) for effect, _ in judged) < 0 else 1
        supporting = [p for effect, p in judged if sign * effect > 0]
        found.append(
            PairTally(
                above=pair[::sign][0],
                below=pair[::sign][1],
                analyses=len(judged),
                supported=len(supporting),
                significant=sum(p < LEVEL for p in supporting),
                least=min(sign * effect for effect, _ in judged),
                largest=max(sign * effect for effect, _ in judged),
            )
        )
    return found


def _curve_json(found: Curve) -> Json:
    claim, tally = found.claim, found.tally
    return {
        "id": claim.id,
        "claim": claim.words,
        "effect": claim.effect,
        **plain(tally),
        "unjudged": plain(found.unjudged),
        "own": found.own,
        "decides": found.decides,
        "moves_most": found.moves_most,
        "moves": plain(found.moves),
        "by_option": {choice: plain(found.by_option(choice)) for choice in found.options},
        "by_effect": [
            {"chosen": plain(chosen), **plain(judged), "supported": claim.supported(judged)}
            for chosen, judged in zip(found.chosen, found.judged, strict=True)
        ],
    }
