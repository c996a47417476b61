"""How often the intervals of the model of the answers hold the truth of virtual people.

`python -m benchmarks.answers [WORLD ...] [--cohorts 200] [--first 0]` prints one line of JSON per
cohort, and `--table FILE...` the table of such lines. Truths are those that the data can hold: see
`analysis.power.answered_cohorts`.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.special import ndtr
from scipy.stats import beta

from analysis.estimates import Estimate, FloatArray, IntArray, NotEstimable
from analysis.power.answered_cohorts import AnsweredCohorts
from analysis.power.null_cohorts import NUMB, with_typical
from analysis.power.people_cohorts import PeopleCohorts
from analysis.sensitivity.answers_model import UNEQUAL, AnswersModel, StudyAnswers, answers_model
from analysis.sensitivity.noticing_stage import NoticingStage
from analysis.simulation import Cohort, joined
from benchmarks.response import how_to
from device.people import answering
from device.people.person import (
    DEFAULT,
    Distribution,
    LogNormal,
    Normal,
    People,
    Population,
    Uniform,
)
from protocol.study.factor import Group
from protocol.study.rules import Rating
from protocol.study.study import Condition, Study
from protocol.study_file.loading import parsed_study, template

SEED = 46
POPULATION = 400
"""People whose mean truth is that of the population."""


def _people(typical: Mapping[str, float], **varied: Distribution) -> Population:
    """Return the default people with these parameters in common, and these varied."""
    people = with_typical(DEFAULT, typical)
    return replace(people, varied={**people.varied, **varied})


MIDDLE = Normal(mean=3.0, sd=1.0)
"""The bias of people whose scores are in the middle of the scale."""


@dataclass(frozen=True, kw_only=True)
class World:
    """A study, the number of its people, and how they feel and score.

    With `scores_change` they score the change itself, not what they felt of it.
    """

    study: Callable[[], Study]
    participants: int
    population: Population = DEFAULT
    scores_change: bool = False


def _paper(sessions: int = 1, **groups: int) -> Study:
    study = parsed_study(template("paper"))
    own = tuple(Group(name=name, size=size) for name, size in groups.items())
    design = study.design.model_copy(update={"sessions": sessions})
    return study.model_copy(update={"group": own, "design": design})


def _extended(**groups: int) -> Study:
    study = parsed_study(template("extended"))
    own = tuple(Group(name=name, size=size) for name, size in groups.items())
    return study.model_copy(update={"group": own})


def _how_to() -> Study:
    return parsed_study(how_to())


def _rated() -> Study:
    """A study that scores what is felt at once, from 1 to 7, at five amplitudes."""
    study = parsed_study(template("paper"))
    touch = study.condition[-1].touches[0]
    first = Condition(name="40 V", touches=(touch,))
    made = [
        first.model_copy(
            update={
                "name": f"{volts} V",
                "touches": (touch.model_copy(update={"voltage_v": float(volts)}),),
            }
        )
        for volts in (40, 80, 120, 160, 200)
    ]
    design = study.design.model_copy(update={"participants": 12, "repeats": 4, "catch_trials": 4})
    rating = Rating(minimum=1, maximum=7)
    return study.model_copy(
        update={"condition": tuple(made), "opening": (), "design": design, "rating": rating}
    )


_IN_EXTENDED: Any = {"study": _extended, "participants": 20}
WORLDS = {
    "W1 paper": World(study=_paper, participants=9),
    "W2 extended": World(**_IN_EXTENDED),
    "W2n extended, middle": World(**_IN_EXTENDED, population=_people({}, bias=MIDDLE)),
    "W3 factorial": World(study=_how_to, participants=12),
    "W3n factorial, middle": World(
        study=_how_to, participants=12, population=_people({}, bias=MIDDLE)
    ),
    "W4 score the change": World(
        **_IN_EXTENDED, population=_people({}, bias=MIDDLE), scores_change=True
    ),
    "W5 no gain": World(**_IN_EXTENDED, population=_people({"gain": 0.0}, bias=MIDDLE)),
    "W6 ceiling": World(**_IN_EXTENDED, population=_people({}, bias=Normal(mean=9.0, sd=1.0))),
    "W7 gain 8, noise .5": World(
        **_IN_EXTENDED,
        population=_people({"rating_noise": 0.5}, bias=MIDDLE, gain=Normal(mean=8.0, sd=2.0)),
    ),
    "W8 lapses 0 to .12": World(
        **_IN_EXTENDED, population=_people({}, bias=MIDDLE, lapse=Uniform(low=0.0, high=0.12))
    ),
    "W9 noise differs": World(
        **_IN_EXTENDED,
        population=_people(
            {},
            bias=MIDDLE,
            felt_noise=LogNormal(median=0.11, log_sd=0.6),
            rating_noise=LogNormal(median=1.0, log_sd=0.6),
        ),
    ),
    "groups": World(
        study=lambda: _extended(young=10, old=10),
        participants=20,
        population=replace(
            _people({}, bias=MIDDLE),
            groups={"old": _people({}, bias=MIDDLE, gain=Normal(mean=7.0, sd=1.5))},
        ),
    ),
    "sessions": World(study=lambda: _paper(sessions=2), participants=9),
    "absolute ratings": World(study=_rated, participants=12),
}
NULLS = {
    "nobody feels anything": World(**_IN_EXTENDED, population=_people(NUMB)),
    "equal gains": World(
        **_IN_EXTENDED, population=_people({"gain": 4.0, "skin": 1.0}, bias=MIDDLE)
    ),
    "equal gains, factorial": World(
        study=_how_to, participants=12, population=_people({"gain": 4.0, "skin": 1.0}, bias=MIDDLE)
    ),
    "nobody feels anything, factorial": World(
        study=_how_to, participants=12, population=_people(NUMB)
    ),
}
"""Worlds in which the group's d is 0, or gains are equal."""


# Cohorts.


class ScoresTheChange(answering.Answering):
    """People who score the change itself, not what they felt of it."""

    def change(
        self, contrast: FloatArray, beyond: FloatArray, two_sided: Any, u: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Return the answers and reaction times, and score the contrast."""
        answers = super().change(contrast, beyond, two_sided, u)
        felt = self.people.gain * (np.abs(contrast) - np.abs(self._felt))
        # Who did not attend felt no change.
        self._pending = self._pending + np.where(u[:, 1] < self.people.lapse, 0.0, felt)
        return answers


@contextmanager
def _scoring_the_change() -> Iterator[None]:
    usual = answering.Answering
    answering.Answering = ScoresTheChange  # type: ignore[misc]
    try:
        yield
    finally:
        answering.Answering = usual  # type: ignore[misc]


@dataclass(frozen=True, kw_only=True, eq=False)
class Truths:
    """Bias, gain, d and criterion of each person, shape (people,).

    d is per unit of predicted contrast, in SDs of the noise, where noticing is unsure; the
    criterion is in SDs of the noise. `group` is the group of each.
    """

    bias: FloatArray
    gain: FloatArray
    d: FloatArray
    criterion: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualAnswers:
    """Cohorts of a world as the model takes them, each with its truths."""

    world: World

    @cached_property
    def _cohorts(self) -> AnsweredCohorts:
        study, people = self.world.study(), self.world.participants
        return AnsweredCohorts(
            cohorts=PeopleCohorts(
                study=study,
                participants=people,
                population=self.world.population,
            )
        )

    @cached_property
    def population(self) -> Truths:
        """The means over the population, or over the means of its groups."""
        made = self._people(POPULATION, f"{SEED}/population")
        truths = self._truths(made)
        groups = self._cohorts.groups(POPULATION)
        means = {
            name: np.array(np.mean([of[groups == one].mean() for one in set(groups.tolist())]))
            for name, of in vars(truths).items()
        }
        return Truths(**means)

    @cached_property
    def apart(self) -> float:
        """By how much the mean gain of the first group exceeds that of the second."""
        truths = self._truths(self._people(POPULATION, f"{SEED}/population"))
        groups = self._cohorts.groups(POPULATION)
        return float(truths.gain[groups == 0].mean() - truths.gain[groups == 1].mean())

    def cohort(self, number: int) -> tuple[StudyAnswers, Truths]:
        """Return the answers of a cohort and the truths of its people."""
        made = self._people(self.world.participants, f"{SEED}/{number}")
        kept, truths = self._cohorts.kept(made), self._truths(made)
        answers = self._cohorts.of_people(made).answers
        return answers, Truths(**{name: of[kept] for name, of in vars(truths).items()})

    def _people(self, participants: int, seed: str) -> Cohort:
        with _scoring_the_change() if self.world.scores_change else nullcontext():
            return joined(self._cohorts.cohorts.simulation.sessions(participants, seed))

    def _truths(self, made: Cohort) -> Truths:
        contrast, sign = self._cohorts.contrasts_of(made), self._cohorts.signs(made)
        lines, people = self._cohorts.lines(made, contrast), made.people
        asked = np.where(np.isfinite(contrast), self._cohorts.asked_before(made), np.nan)
        noise = people.felt_noise * (1 + people.fatigue * np.nanmean(asked, axis=1))
        felt = sign * made.contrast
        return Truths(
            bias=lines.bias,
            gain=lines.gain,
            d=_weighted_slope(people, contrast, felt, sign, noise) / noise,
            criterion=(people.criterion + people.criterion_less) / 2 / noise,
        )


def _weighted_slope(
    people: People, contrast: FloatArray, felt: FloatArray, sign: FloatArray, noise: FloatArray
) -> FloatArray:
    """Return the slope of what is felt on the contrast, weighted by what answers tell of it.

    Of a change that everybody notices they tell nothing. Catch trials count as well.
    """
    known = np.isfinite(contrast)
    criterion = np.where(sign > 0, people.criterion[:, None], people.criterion_less[:, None])
    a = (felt - criterion) / noise[:, None]
    weight = np.exp(-(a**2)) / (ndtr(a) * ndtr(-a)) * known
    x = np.where(known, contrast, 0.0)
    away = x - ((weight * x).sum(axis=1) / weight.sum(axis=1))[:, None]
    return np.asarray((weight * away * felt).sum(axis=1) / (weight * away**2).sum(axis=1))


# One cohort, measured.


def measured(virtual: VirtualAnswers, number: int) -> dict[str, Any]:
    """Return which truths the intervals of a cohort hold, and what is claimed of it."""
    answers, truths = virtual.cohort(number)
    population = virtual.population
    start_s = process_time()
    model = answers_model(answers)
    row: dict[str, Any] = {"cohort": number, "people": len(truths.bias)}
    row["noticed"] = answers.answered.share_noticed if answers.answered else 1.0
    if answers.answered is None:
        pass
    elif isinstance(first := model.noticing, NotEstimable):
        row["noticing_reason"] = first.reason
    else:
        row |= _of_noticing(first, answers.answered.unit, truths, population)
    row |= _of_rating(model, virtual, truths, population)
    return {**row, "cpu_s": process_time() - start_s}


def _of_noticing(
    first: NoticingStage, unit: float, truths: Truths, population: Truths
) -> dict[str, Any]:
    d, criterion = first.slopes, first.criteria
    return {
        **_held("d", d[:-1], unit * truths.d),
        **_held("group_d", d[-1:], unit * population.d),
        **_held("criterion", criterion[:-1], truths.criterion),
        **_held("group_criterion", criterion[-1:], population.criterion),
        "d_p": first.p,
    }


def _of_rating(
    model: AnswersModel, virtual: VirtualAnswers, truths: Truths, population: Truths
) -> dict[str, Any]:
    rating = model.rating
    if isinstance(rating, NotEstimable):
        return {"rating_reason": rating.reason}
    x, rated = rating.ready.axes.x_mean, rating.ready.counts > 0
    row: dict[str, Any] = {
        **_held("group_gain", [rating.of_group("gain")], population.gain),
        **_held("group_bias", [rating.of_group("bias")], population.bias),
        **_held("group_level", [rating.of_group("level")], population.bias + x * population.gain),
        **_held("gain", rating.of_subjects("gain"), truths.gain, rated),
        **_held(
            "relative",
            rating.of_subjects("relative gain"),
            truths.gain - truths.gain[rated].mean(),
            rated,
        ),
        **_held("bias", rating.of_subjects("bias"), truths.bias, rated),
        **_held("level", rating.of_subjects("level"), truths.bias + x * truths.gain, rated),
        "equal": rating.equal_gains,
        "gains_differ": rating.equal_gains < UNEQUAL,
        "sd_below": rating.gain_sd_upper,
        "gain_sd": float(truths.gain.std(ddof=1)),
        "told": model.untold is None,
        "highest": model.highest,
        "open": model.usual_open_share,
    }
    if rating.selection is not None:
        low, high = rating.selection.interval
        row |= {"selection": rating.selection.value, "selection_width": high - low}
    if apart := rating.apart("gains"):
        row |= _held("groups_apart", apart, np.array(virtual.apart))
    return row


def _held(
    name: str, estimates: Sequence[Estimate], truth: FloatArray, used: Any = None
) -> dict[str, float]:
    """Return the share of intervals that hold the truth, their mean width, and the mean error."""
    # Of somebody without noise there is no d.
    chosen = np.isfinite(np.broadcast_to(truth, len(estimates)))
    chosen &= True if used is None else np.asarray(used, dtype=np.bool_)
    low, high = np.array([estimate.interval for estimate in estimates])[chosen].T
    values = np.array([estimate.value for estimate in estimates])[chosen]
    truth = np.broadcast_to(truth, len(estimates))[chosen]
    return {
        name: float(((low <= truth) & (truth <= high)).mean()),
        f"{name}_width": float((high - low).mean()),
        f"{name}_error": float((values - truth).mean()),
        f"{name}_truth": float(truth.mean()),
    }


# Tables.

ROWS = {
    "group_gain": "group's gain",
    "gain": "gains",
    "relative": "relative gains",
    "group_level": "group's level",
    "level": "levels",
    "bias": "biases",
    "group_d": "group's d",
    "d": "d",
    "criterion": "criteria",
    "groups_apart": "groups apart",
}
LEAST = 0.95


def falls_short(shares: Sequence[float]) -> bool:
    """Return whether the upper end of the 95% binomial interval of a share is below .95.

    Intervals of people of one study go together, so that a cohort counts as one.
    """
    count = len(shares)
    held = float(np.sum(shares))
    upper = 1.0 if held >= count else float(beta.ppf(0.975, held + 1, count - held))
    return upper < LEAST


def table(lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield coverage by world, in bold where a row falls short."""
    rows: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for line in lines:
        rows[line["world"]].append(line)
    more = ["told", "gains differ", "d > 0", "CPU s"]
    yield f"| world | cohorts (with gains) | {' | '.join([*ROWS.values(), *more])} |"
    yield "|---" * (len(ROWS) + len(more) + 2) + "|"
    for world, some in rows.items():
        cells = [_cell(some, name) for name in ROWS]
        rated = [row for row in some if "gain" in row]
        told = [
            _mean(rated, "told"),
            _mean(rated, "gains_differ"),
            f"{np.mean([row.get('d_p', 1.0) < 0.05 for row in some]):.3f}",
            _mean(some, "cpu_s"),
        ]
        yield f"| {' | '.join([world, f'{len(some)} ({len(rated)})', *cells, *told])} |"


def _cell(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    values = [row[name] for row in rows if name in row]
    if not values:
        return "–"
    mark = "**" * falls_short(values)
    error, width = (_mean(rows, f"{name}_{what}") for what in ("error", "width"))
    return f"{mark}{np.mean(values):.3f}{mark} ({error}, {width})"


def _mean(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    values = [row[name] for row in rows if name in row]
    return f"{np.mean(values):.2f}" if values else "–"


KEPT = Path("analysis/sensitivity/coverage.json")
OBSERVABLE = ("W1", "W2", "W2n", "W3", "W3n", "W6", "groups", "sessions", "absolute")
"""Worlds that a study can be seen to be like."""


def kept_rows(lines: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the rows of `KEPT`, which the report quotes: see `analysis.sensitivity.coverage`."""
    rows: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for line in lines:
        rows[line["world"]].append(line)
    for name, world in WORLDS.items():
        if name not in rows:
            continue
        rated = [row for row in rows[name] if "gain" in row]
        values = {of: [row[of] for row in rows[name] if of in row] for of in ROWS}
        yield {
            "name": name.partition(" ")[2] if name.startswith("W") else name,
            "studies": len(rows[name]),
            "people": round(float(np.mean([row["people"] for row in rated])), 1),
            "trials": round(_rated_trials(world), 1),
            "noticed": round(float(np.mean([row["noticed"] for row in rated])), 3),
            "highest": round(float(np.mean([row["highest"] for row in rated])), 3),
            "held": {ROWS[of]: round(float(np.mean(it)), 3) for of, it in values.items() if it},
            "too_few": [ROWS[of] for of, it in values.items() if it and falls_short(it)],
            "observable": name.split(" ")[0] in OBSERVABLE,
            "absolute": world.study().absolute,
        }


def _rated_trials(world: World) -> float:
    """Return the rated trials of a person in a few cohorts."""
    virtual = VirtualAnswers(world=world)
    counts = [
        np.isfinite(answers.rated.rating).sum() / len(answers.ratings.subjects)
        for answers, _ in map(virtual.cohort, range(5))
    ]
    return float(np.mean(counts))


def main() -> None:
    """Print measured cohorts, or the table of those in files."""
    parser = argparse.ArgumentParser(description=__doc__)
    every = WORLDS | NULLS
    parser.add_argument("worlds", nargs="*", help=", ".join(every))
    parser.add_argument("--cohorts", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--table", nargs="+", type=Path, help="files of printed lines")
    parser.add_argument("--write", nargs="+", type=Path, help="files of printed lines")
    options = parser.parse_args()
    if options.write:
        texts = [path.read_text(encoding="utf-8") for path in options.write]
        lines = [json.loads(line) for text in texts for line in text.splitlines()]
        # Worlds that were not measured anew keep their rows.
        rows = {row["name"]: row for row in json.loads(KEPT.read_text(encoding="utf-8"))}
        rows |= {row["name"]: row for row in kept_rows(lines)}
        kept = json.dumps(list(rows.values()), indent=1, ensure_ascii=False)
        KEPT.write_text(f"{kept}\n", encoding="utf-8")
        return
    if options.table:
        texts = [path.read_text(encoding="utf-8") for path in options.table]
        print(*table([json.loads(line) for text in texts for line in text.splitlines()]), sep="\n")
        return
    virtual = {name: VirtualAnswers(world=every[name]) for name in options.worlds or every}
    # Cohort by cohort, so that whatever is ended early has as many of each world.
    for number in range(options.first, options.first + options.cohorts):
        for name, of_world in virtual.items():
            print(json.dumps({"world": name, **measured(of_world, number)}), flush=True)


if __name__ == "__main__":
    main()
