"""Specification curve of a claim: all its analyses by effect, and the choice that moves it most.

Simonsohn, Simmons and Nelson, Nature Human Behaviour 4, 2020.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from analysis.estimates import Json, NotEstimable, plain
from analysis.loading.sessions import Sessions
from analysis.loading.study_data import StudyData
from analysis.multiverse.choices import Choice
from analysis.multiverse.named_claims import (
    Claim,
    Judged,
    named_claims,
    pair_differences,
    pair_p,
)
from analysis.multiverse.universes import Options, Universe, universes
from analysis.statistics.signed_rank import LEVEL
from device.friction.calibration import NOMINAL, Calibration
from protocol.study.study import Study

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

    claim: Claim
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
        return {option: self._tally(self._with(choice, option)) for option in self.options[choice]}

    def _with(self, choice: Choice, option: str) -> list[Judged]:
        both = zip(self.chosen, self.judged, strict=True)
        return [judged for chosen, judged in both if chosen.get(choice) == option]

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
        means = {
            choice: [each.mean_effect for each in self.by_option(choice).values()]
            for choice in self.options
        }
        return {choice: max(of_options) - min(of_options) for choice, of_options in means.items()}

    @property
    def moves_most(self) -> Choice | None:
        """The choice that moves the effect most, None if none does."""
        choice = max(self.moves, key=lambda it: self.moves[it], default=None)
        return choice if choice is not None and self.moves[choice] > _EQUAL else None

    @property
    def decides(self) -> Choice | None:
        """The choice that alone decides the verdicts, which are not all the same; None if none.

        A verdict is whether the claim is supported, and whether with p < .05.
        """
        for choice in self.options:
            tallies = self.by_option(choice).values()
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
    claims: Sequence[Claim] | None = None,
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


def curve(claim: Claim, analyses: Sequence[Universe]) -> Curve:
    """Return the curve of a claim; the first of the analyses is the report's own."""
    found = [(universe.chosen, claim.judge(universe)) for universe in analyses]
    known = [(chosen, it) for chosen, it in found if isinstance(it, Judged)]
    options = {
        choice: tuple(dict.fromkeys(chosen[choice] for chosen, _ in known if choice in chosen))
        for choice in Choice
    }
    known.sort(key=lambda each: each[1].effect)
    own = [place for place, (chosen, _) in enumerate(known) if chosen is found[0][0]]
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
    for one, other in combinations(readings[0].table4.table.conditions, 2):
        both = [
            (float(differences.mean()), pair_p(it, one, other))
            for it in readings
            if (differences := pair_differences(it, one, other)).size
        ]
        if not both:
            continue
        turned = sum(np.sign(effect) for effect, _ in both) < 0
        effects = [(-effect if turned else effect) for effect, _ in both]
        found.append(
            PairTally(
                above=other if turned else one,
                below=one if turned else other,
                analyses=len(both),
                supported=sum(effect > 0 for effect in effects),
                significant=sum(
                    effect > 0 and p < LEVEL for effect, (_, p) in zip(effects, both, strict=True)
                ),
                least=min(effects),
                largest=max(effects),
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
