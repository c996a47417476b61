"""Null cohorts: people of whom some or all claims are false, and the tables of what they answer."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256

import numpy as np

from analysis.estimates import FloatArray, IntArray
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.study_records import BY_GROUP, GROUP_GAIN, GROUP_SCORE, Asked
from analysis.simulation import Cohort, PlannedTrials, Tables
from analysis.statistics.factorial import SESSION, effects_of
from device.people.person import Population
from protocol.registration.registration import FOLLOWS, NOTICED, effect_of
from protocol.study.rules import PAPERS_SCALE

NUMB = {
    "skin": 0.0,
    "gain": 0.0,
    # At random "swapped" is said more often, of two answers, than "smoother", of three.
    "lapse": 0.0,
    **{f"beyond_{kind}": 0.0 for kind in ("swing", "strength", "ramp", "press")},
}
"""People who feel no change and score none higher than another."""


@dataclass(frozen=True, kw_only=True)
class NullKind:
    """A kind of null cohort.

    `typical` has the parameters that all its people have in common. The SD `spread` is that of the
    conditions' own natures, in points of the paper's scale, of which the prediction knows nothing.
    `true` has the kinds of claims that are true (`kind_of`).
    """

    name: str
    typical: Mapping[str, float] = field(default_factory=dict)
    spread: float = 0.0
    true: frozenset[str] = frozenset()

    def is_false(self, asked: Asked, claim: str) -> bool:
        """Return whether a claim of the family would be false."""
        return kind_of(asked, claim) not in self.true

    def population(self, people: Population) -> Population:
        """Return these people, and those of each group, as the kind has them."""
        return with_typical(people, self.typical)


KINDS = (
    # The responses of people who feel changes, shuffled: every claim is false.
    NullKind(name="nobody feels anything"),
    # They report four changes in five, whatever the contrast, and as often where there is none.
    # That conditions differ, also by factors, is true.
    NullKind(
        name="conditions differ, gain 0",
        typical={**NUMB, "criterion": -0.1},
        spread=1.0,
        true=frozenset({"conditions"}),
    ),
    # Large contrasts are noticed more often and scored no higher: responses follow them.
    NullKind(
        name="noticing by contrast, gain 0",
        typical={"gain": 0.0},
        true=frozenset({"conditions", "slope", "noticed"}),
    ),
)
SHUFFLED, DIFFERING, NOTICING = KINDS
# Who scores what is felt, and not a change, notices nothing.
ALIKE = NullKind(name="gain 0, no difference", typical={"skin": 0.0, "gain": 0.0})


def kinds_of(asked: Asked) -> tuple[NullKind, ...]:
    """Return the kinds that are null cohorts of a study."""
    return (ALIKE, DIFFERING) if asked.absolute else KINDS


def kind_named(name: str) -> NullKind:
    """Return the kind of that name."""
    return next(kind for kind in (*KINDS, ALIKE) if kind.name == name)


def kind_of(asked: Asked, claim: str) -> str:
    """Return what a claim of the family is about."""
    kinds = {FOLLOWS: "slope", GROUP_GAIN: "gains", BY_GROUP: "profiles"}
    sessions = {effect_of(*it) for it in effects_of(asked.factors) if SESSION in it}
    if claim in kinds:
        return kinds[claim]
    if claim.endswith(NOTICED):
        return "noticed"
    if claim in sessions:
        return "sessions"
    return "groups" if claim == GROUP_SCORE or "between groups" in claim else "conditions"


def with_typical(people: Population, typical: Mapping[str, float]) -> Population:
    """Return a population, and those of its groups, with these parameters in common."""
    varied = {name: how for name, how in people.varied.items() if name not in typical}
    groups = {name: with_typical(own, typical) for name, own in people.groups.items()}
    return replace(people, typical=replace(people.typical, **typical), varied=varied, groups=groups)


# Tables of null cohorts.


def null_tables(kind: NullKind, cohorts: PeopleCohorts, keys: Sequence[str]) -> Tables:
    """Return what the tests take of the null cohorts of `keys`, whose people are of that kind."""
    simulation, participants = cohorts.simulation, cohorts.participants
    sessions = simulation.sessions(participants, *keys)
    if kind.spread:
        natures = np.array(
            [nature(key, kind.spread, len(cohorts.study.conditions)) for key in keys]
        )
        for number, made in enumerate(sessions):
            sessions[number] = shifted(simulation.planned, made, natures, keys, number)
    tables, _ = simulation.tables(participants, sessions)
    streams = [_stream(f"{key}/shuffled") for key in keys]
    if kind is SHUFFLED:
        return without_effect(tables, streams)
    # Groups may be drawn from populations of their own: without an effect they are one.
    mixed = [rng.permutation(groups) for groups, rng in zip(tables.groups, streams, strict=True)]
    return tables._replace(groups=np.stack(mixed))


def _stream(name: str) -> np.random.Generator:
    # Apart from those that drew the study.
    return np.random.default_rng(np.frombuffer(sha256(name.encode()).digest(), dtype=np.uint32))


def nature(key: str, spread: float, conditions: int) -> FloatArray:
    """Return by how many points the conditions of a cohort are scored higher, (conditions,)."""
    return spread * np.random.default_rng([*key.encode()]).normal(size=conditions)


def shifted(
    planned: PlannedTrials, made: Cohort, points: FloatArray, keys: Sequence[str], session: int
) -> Cohort:
    """Return a session of cohorts in which conditions are scored higher, between the ends.

    `points` (cohorts, conditions) are of the paper's scale.
    """
    conditions, rating = planned.study.conditions, planned.study.rating
    names = [kind.trial.condition for kind in planned.kinds]
    of_kinds = np.array([conditions.index(it) if it in conditions else -1 for it in names])
    score, size = made.score.copy(), len(made.score) // len(keys)
    points = points * (rating.span / PAPERS_SCALE.span)
    for cohort, key in enumerate(keys):
        rows = slice(cohort * size, (cohort + 1) * size)
        score[rows] += points[cohort][of_kinds[made.kinds[rows]]]
        # Whole scores, rounded at random, so that means rise by all of the points.
        score[rows] += np.random.default_rng([*key.encode(), 1 + session]).random(score[rows].shape)
    return replace(made, score=np.floor(score).clip(rating.minimum, rating.maximum))


def without_effect(tables: Tables, streams: Iterable[np.random.Generator]) -> Tables:
    """Return tables without any effect, with a stream for each cohort.

    Each subject's responses are shuffled over the conditions, and over the sessions of a condition.
    How people answer stays; the conditions mean nothing any more, so that every difference, and
    every difference between gains, is 0. Subjects are shuffled between groups, and each one's
    reported changes are drawn anew over all trials, so that with a signal they are no more than
    without.
    """
    cohorts = []
    for responses, noticed, by_session, groups, rng in zip(*tables, streams, strict=True):
        # Each row on its own, so that a person's level stays and only the conditions lose their
        # meaning.
        order = rng.permuted(np.tile(np.arange(responses.shape[1]), (len(responses), 1)), axis=1)
        answered = np.take_along_axis(responses, order, axis=1)
        reported = _unnoticed(noticed, rng)
        apart = rng.permuted(np.take_along_axis(by_session, order[..., None], axis=1), axis=2)
        cohorts.append((answered, reported, apart, rng.permutation(groups)))
    return Tables(*(np.stack(table) for table in zip(*cohorts, strict=True)))


def _unnoticed(noticed: IntArray, rng: np.random.Generator) -> IntArray:
    reported, trials = noticed[..., 0], noticed[..., 1]
    drawn = [
        # `marginals` takes as long for a thousand trials as for ten.
        rng.multivariate_hypergeometric(of_person, int(reports), method="marginals")
        for of_person, reports in zip(trials, reported.sum(axis=1), strict=True)
    ]
    return np.stack([np.array(drawn), trials], axis=-1)
