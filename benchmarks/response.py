"""How often tests of responses find what is there, and claim what is not.

`python -m benchmarks.response` prints the tables of docs/mathematics/response.md: the power of the
how-to's factorial study; the share of reports with a false claim of any kind, in worlds in which
nothing or little is true; what a study that scores what is felt at once claims, with its own null
worlds and the default people; and what a slope per person would claim in place of the permuted one.
Each study goes through its plan, virtual people, the tests of the report and its one correction
over all questions, as `touchbeam power` simulates it.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.special import stdtr
from scipy.stats import friedmanchisquare

from analysis.estimates import LEVEL, FloatArray, IntArray
from analysis.power.designs import Design, designed
from analysis.power.null_cohorts import (
    ALIKE,
    DIFFERING,
    NOTICING,
    NUMB,
    SHUFFLED,
    NullKind,
    kind_of,
    nature,
    shifted,
    with_typical,
)
from analysis.power.power_summary import Measured, claims, share
from analysis.power.study_records import (
    GROUP_SCORE,
    Asked,
    Records,
    asked_by,
    pair_of,
    record_of_tables,
)
from analysis.simulation import Simulation, mean_table
from device.friction.calibration import Calibration
from device.people import person
from device.people.person import DEFAULT, Population
from protocol.registration.registration import FOLLOWS, OMNIBUS, effect_of
from protocol.study.factor import Group
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from runner.study.surface import surface_of

SEED = 45
COHORTS = 360
HOW_TO = 60
"""Cohorts of the how-to's study."""
AT_ONCE = 30


# Studies.


def how_to() -> str:
    """Return the text of the how-to's factorial study."""
    text = Path("docs/how-to/factorial.md").read_text(encoding="utf-8").split("```toml", 1)[1]
    return text.partition("\n")[2].partition("```")[0]


def _paper(participants: int = 9, repeats: int = 1, sessions: int = 1, **groups: int) -> Study:
    study = parsed_study(template("paper"))
    own = tuple(Group(name=name, size=size) for name, size in groups.items())
    design = study.design.model_copy(update={"sessions": sessions})
    study = study.model_copy(update={"group": own, "design": design})
    return designed(study, Design(participants=participants, repeats=repeats))


def _factorial(*, whole: bool) -> Study:
    study = parsed_study(how_to())
    design = study.design.model_copy(update={"sessions": 1, "hours_between": None})
    alone = study.model_copy(update={"group": (), "design": design})
    return designed(study if whole else alone, Design(participants=12, repeats=1))


def _plate(size: int) -> Study:
    """Return the template that scores what is felt at once, from 1 to 7, with groups of a size."""
    # Nobody sees the plate's picture.
    lines = template("plate").splitlines()
    text = "\n".join(line for line in lines if "path_in_picture" not in line)
    study = parsed_study(text.replace('picture = "plate.png"', 'picture = "none"'))
    groups = tuple(group.model_copy(update={"size": size}) for group in study.group)
    return study.model_copy(update={"group": groups})


STUDIES: dict[str, Callable[[], tuple[Study, int]]] = {
    "plain": lambda: (_paper(9), 9),
    "factorial": lambda: (_factorial(whole=False), 12),
    "grouped": lambda: (_paper(16, young=8, old=8), 16),
    "two sessions": lambda: (_paper(9, sessions=2), 9),
    "the how-to's": lambda: (_factorial(whole=True), 12),
    "20 people x 4": lambda: (_paper(20, repeats=4), 20),
    "three groups": lambda: (_paper(24, young=8, middle=8, old=8), 24),
    "absolute, 6 a group": lambda: (_plate(6), 12),
    "absolute, 10 a group": lambda: (_plate(10), 20),
}
"""Each study with its number of people."""
IN_ABSOLUTE = ("absolute, 6 a group", "absolute, 10 a group")
IN_NULLS = ("plain", "factorial", "grouped", "two sessions", "the how-to's")


# Worlds: what people feel, how conditions differ besides, and so which claims would be true.


@dataclass(frozen=True, kw_only=True)
class World:
    """Virtual people, and points by which they score conditions higher besides.

    `points` are of the first conditions, 0 of the others; the SD `spread` draws them for all, anew
    in each cohort: the conditions' own natures, of which the prediction knows nothing. `true` has
    the kinds of claims that are true (`kind_of`), but for pairs among those that are `alike`.
    """

    population: Population
    points: tuple[float, ...] = ()
    spread: float = 0.0
    true: frozenset[str] = frozenset()
    alike: tuple[str, ...] = ()

    def is_false(self, asked: Asked, claim: str) -> bool:
        """Return whether a claim of the family would be false."""
        pairs = (pair_of(*pair) for pair in combinations(self.alike, 2))
        return kind_of(asked, claim) not in self.true or any(pair in claim for pair in pairs)

    def points_of(self, key: str, conditions: int) -> FloatArray:
        """Return the points of each condition in a cohort."""
        points = nature(key, self.spread, conditions)
        points[: len(self.points)] += self.points
        return points


def _people(typical: Mapping[str, float]) -> Population:
    """Return the default people with these parameters in common."""
    return with_typical(DEFAULT, typical)


def _world(kind: NullKind) -> World:
    return World(population=kind.population(DEFAULT), spread=kind.spread, true=kind.true)


_SURE = {**NUMB, "criterion": -10.0}
"""They report every change, whatever the contrast, and as often where there is none."""

NULLS = {
    # As virtual people, where a power analysis shuffles what people who feel changes answered.
    SHUFFLED.name: replace(_world(SHUFFLED), population=_people(NUMB)),
    DIFFERING.name: _world(DIFFERING),
    NOTICING.name: _world(NOTICING),
}
ABSOLUTE = {
    "nobody feels anything": _world(ALIKE),
    "conditions differ, gain 0": _world(DIFFERING),
    "the default people": World(population=DEFAULT, true=frozenset({"conditions", "slope"})),
}
"""Worlds of a study that asks for no change: who scores what is felt notices nothing."""
ALONE = {
    # The prediction is wrong, and every pair differs.
    "the conditions, all of them": World(
        population=_people(_SURE), spread=2.0, true=frozenset({"conditions"})
    ),
    # All pairs of the others are false.
    "one of the conditions": World(
        population=_people(_SURE),
        points=(-3.0,),
        true=frozenset({"conditions"}),
        alike=("structure", "voltage", "direction", "pressure"),
    ),
    # They score lower throughout.
    "one of the groups": World(
        population=replace(_people(_SURE), groups={"old": _people({**_SURE, "bias": 4.0})}),
        true=frozenset({"groups"}),
        alike=("young", "middle"),
    ),
}
"""Worlds with one true effect, so large that it is nearly always claimed."""
WITH_ALONE = {
    "the conditions, all of them": "grouped",
    "one of the conditions": "grouped",
    "one of the groups": "three groups",
}
"""The study in each of these."""
ALL_NOTICED = replace(NULLS[DIFFERING.name], population=_people(_SURE))


# Cohorts of a study in a world, as the report tests them.


@dataclass(frozen=True, kw_only=True, eq=False)
class Reports:
    """The reports of many cohorts: p as in `Records`, and those of two peers.

    They are a t test of people's slopes, and scipy's Friedman test, whose p is that of chi-square.
    """

    asked: Asked
    p: FloatArray
    t_of_slopes: FloatArray
    scipys: FloatArray
    complete: IntArray
    """People with a score under each condition."""

    def rejects(self, name: str) -> Measured:
        """Return how often a test's own p is below .05."""
        return share(self.p[:, self.asked.tests.index(name)] < LEVEL)

    def supports(self, name: str) -> Measured:
        """Return how often a report claims it."""
        return share(claims(self.asked, self.p)[name])

    def false(self, world: World) -> tuple[Measured, dict[str, Measured]]:
        """Return how often a report claims anything false, and each claim that is, with its own."""
        false = {
            name: made
            for name, made in claims(self.asked, self.p).items()
            if world.is_false(self.asked, name)
        }
        return share(np.logical_or.reduce([np.zeros(len(self.p), np.bool_), *false.values()])), {
            name: share(made) for name, made in false.items()
        }


def reports(name: str, world: World, cohorts: int) -> Reports:
    """Return the reports of the first cohorts of a study in a world."""
    study, participants = STUDIES[name]()
    surface = surface_of(Path(), study)
    touched = person.World(surface=surface)
    simulation = Simulation(study=study, population=world.population, world=touched)
    asked = asked_by(study, Calibration.of(surface))
    records, t_of_slopes, scipys, complete = [], [], [], []
    for first in range(0, cohorts, AT_ONCE):
        keys = [f"{SEED}/{number}" for number in range(first, min(first + AT_ONCE, cohorts))]
        sessions = simulation.sessions(participants, *keys)
        points = np.array([world.points_of(key, len(study.conditions)) for key in keys])
        for number, made in enumerate(sessions):
            sessions[number] = shifted(simulation.planned, made, points, keys, number)
        tables, everybody = simulation.tables(participants, sessions)
        records += [record_of_tables(asked, *table) for table in zip(*tables, strict=True)]
        t_of_slopes += [_t_of_slopes(asked, responses) for responses in tables.responses]
        scipys += [_scipys_friedman(responses) for responses in tables.responses]
        scores = mean_table(simulation.planned, everybody, everybody.score)
        complete += (~np.isnan(scores)).all(axis=1).reshape(-1, participants).sum(axis=1).tolist()
    return Reports(
        asked=asked,
        p=Records.of(asked, records).p,
        t_of_slopes=np.array(t_of_slopes),
        scipys=np.array(scipys),
        complete=np.array(complete),
    )


def _t_of_slopes(asked: Asked, responses: FloatArray) -> float:
    """Return the p of the t test of people's own slopes on the contrasts."""
    centred = np.array(asked.contrasts) - np.mean(asked.contrasts)
    slopes = responses[~np.isnan(responses).any(axis=1)] @ centred
    t = slopes.mean() / (slopes.std(ddof=1) / np.sqrt(len(slopes)))
    return float(2 * stdtr(len(slopes) - 1, -abs(t)))


def _scipys_friedman(responses: FloatArray) -> float:
    """Return the p of scipy's Friedman test of the people who answered every condition."""
    return float(friedmanchisquare(*responses[~np.isnan(responses).any(axis=1)].T).pvalue)


# Tables.


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cohorts", type=int, default=COHORTS, help="of each study in each world")
    parser.add_argument("--tables", nargs="*", choices=TABLES, help="all without it")
    options = parser.parse_args()
    cohorts = options.cohorts
    for name in options.tables or TABLES:
        print(*TABLES[name](HOW_TO if name == "power" else cohorts), "", sep="\n", flush=True)


def _power(cohorts: int) -> Iterator[str]:
    """Yield the power of the how-to's study with the default people."""
    made = reports("the how-to's", World(population=DEFAULT), cohorts)
    yield f"| the how-to's study, {cohorts} cohorts | own p below .05 | claimed |"
    yield "|---|---|---|"
    for name in (OMNIBUS, FOLLOWS, *map(effect_of, made.asked.factors)):
        yield f"| {name} | {_told(made.rejects(name))} | {_told(made.supports(name))} |"
    before = share(made.complete >= 2)
    yield f"| two people with a score of every condition | {_told(before)} | – |"


def _nulls(cohorts: int) -> Iterator[str]:
    """Yield how often a report claims something false where no question has a true answer."""
    yield f"| any false claim, {cohorts} cohorts | {' | '.join(NULLS)} |"
    yield "|---|" + "---|" * len(NULLS)
    for name in IN_NULLS:
        rows = [reports(name, world, cohorts).false(world) for world in NULLS.values()]
        yield f"| {name} | {' | '.join(_worst(*row) for row in rows)} |"


def _absolute(cohorts: int) -> Iterator[str]:
    """Yield what a study that scores what is felt at once claims, and how often falsely."""
    heads = (OMNIBUS, "of scipy's p", "claimed", FOLLOWS, "claimed", "any false claim")
    yield f"| absolute, {cohorts} cohorts | {' | '.join(heads)} |"
    yield "|---|" + "---|" * len(heads)
    for label, world in ABSOLUTE.items():
        for name in IN_ABSOLUTE:
            made = reports(name, world, cohorts)
            omnibus = (made.rejects(OMNIBUS), share(made.scipys < LEVEL), made.supports(OMNIBUS))
            follows = (made.rejects(FOLLOWS), made.supports(FOLLOWS))
            shares = [*map(_told, (*omnibus, *follows)), _worst(*made.false(world))]
            yield f"| {label}; {name} | {' | '.join(shares)} |"


def _slopes(cohorts: int) -> Iterator[str]:
    """Yield how often responses are found to follow contrasts that they do not follow."""
    yield f"| conditions differ, gain 0; {cohorts} cohorts | permuted | t of people's slopes |"
    yield "|---|---|---|"
    worlds = {"four in five": NULLS[DIFFERING.name], "all": ALL_NOTICED}
    for name in ("plain", "20 people x 4", "factorial"):
        for noticed, world in worlds.items():
            made = reports(name, world, cohorts)
            by_t = share(made.t_of_slopes < LEVEL)
            shares = f"{_told(made.rejects(FOLLOWS))} | {_told(by_t)}"
            yield f"| {name}, {noticed} of the changes noticed | {shares} |"


def _alone(cohorts: int) -> Iterator[str]:
    """Yield how often a report claims something false beside one true effect."""
    yield f"| what alone differs, {cohorts} cohorts | true effect claimed | any false claim |"
    yield "|---|---|---|"
    for label, world in ALONE.items():
        made = reports(WITH_ALONE[label], world, cohorts)
        true = made.supports(GROUP_SCORE if "groups" in world.true else OMNIBUS)
        yield f"| {label} | {_told(true)} | {_worst(*made.false(world))} |"


def _told(measured: Measured) -> str:
    return f"{measured.value:.3f} ± {measured.error:.3f}".replace("0.", ".")


def _worst(anything: Measured, each: Mapping[str, Measured]) -> str:
    """Return how often anything is claimed, with the claim that is made most often."""
    if not each:
        return "nothing that could be claimed is false"
    name = max(each, key=lambda it: each[it].value)
    return f"{_told(anything)} ({name}: {each[name].value:.3f})"


TABLES = {
    "power": _power,
    "nulls": _nulls,
    "absolute": _absolute,
    "slopes": _slopes,
    "alone": _alone,
}


if __name__ == "__main__":
    main()
