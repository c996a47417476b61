"""Draws the reference posteriors of noticing and rating that are kept beside this file, by NUTS.

No test runs this program, and `make test` does not install what it needs (numpyro, scipy). To draw
again: `python -m venv V && V/bin/pip install numpyro scipy`, then, from the root of the repository,
`V/bin/python -m tests.analysis.sensitivity.reference.sample_posteriors NAME` for one of STUDIES,
or for `noticing_` or `rating_` and one of ANSWERED. It shares no code with the model that the tests
compare with it. Only the column of who noticed is the model's: it is data of the ratings.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
import numpyro.distributions as dist
from jax.scipy.special import log_ndtr
from numpy.typing import NDArray
from numpyro.diagnostics import effective_sample_size, gelman_rubin
from numpyro.infer import MCMC, NUTS, init_to_value

from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing_stage import Answered, NoticingStage, noticing_stage
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study

HERE = Path(__file__).parent
CHAINS, SEED = 4, 20
WIDE = 10.0
LAPSE = 0.02
SELECTION_SD, COLUMN_SD = 0.5, 1.0
# Predicted contrasts of the published conditions under the law `consistent`, on the report's rung.
CONTRASTS = {
    "frequency": 0.18668327287919848,
    "structure": 0.10926095317375928,
    "voltage": 0.405845935730761,
    "direction": 0.4468376083428817,
    "pressure": 0.04279043106610852,
}
TABLE_4 = """
10  8 10 10 5
10 10 10  8 7
 8  8  8  7 4
10 10 10 10 8
 8  8 10  8 5
 8 10 10 10 7
 7 10  9  8 7
 7  8 10  7 8
 8  8 10  7 5
"""
MIDDLE = VirtualPopulation(bias=3.0, gain=6.0, gain_sd=2.0, noise_sd=1.0)
CEILING = VirtualPopulation(bias=7.5, gain=7.0, gain_sd=2.0, noise_sd=1.0)
OFF_THE_LINE = VirtualPopulation(bias=3.0, gain=6.0, gain_sd=2.0, noise_sd=1.0, discrepancy_sd=0.8)
# Population, subjects, repeats and seed; the published table has no population.
STUDIES = {
    "table_4": None,
    "middle_9x5x1": (MIDDLE, 9, 1, 101),
    "ceiling_9x5x4": (CEILING, 9, 4, 102),
    "off_the_line_20x5x8": (OFF_THE_LINE, 20, 8, 103),
}
CENTRED = {"off_the_line_20x5x8"}
Columns = dict[str, list[float]]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Run:
    """How long each chain is, and how many steps, as a power of 2, a draw may take."""

    warm_up: int = 2000
    draws: int = 5000
    depth: int = 10


RUNS = {
    "table_4": Run(draws=10000),
    "middle_9x5x1": Run(draws=30000),
    "ceiling_9x5x4": Run(draws=30000),
    "noticing_12x5x4": Run(warm_up=1000, draws=2500),
    "noticing_20x5x8": Run(warm_up=1000, draws=2500),
    "rating_9x5x1": Run(warm_up=1000, draws=5000, depth=8),
    "rating_12x5x4": Run(warm_up=1000, draws=2500),
}


@dataclass(frozen=True, kw_only=True)
class Answering:
    """People who notice a change and then score what they felt, and their study.

    Noise and criterion are in contrast, `lean` is by how much less readily the first answer of a
    question is given; level (at contrast 0), gain and the noise of ratings are in points. Each of
    five conditions comes `repeats` times, and as many `catches` as repeats if there are any. With
    `both_orders` the expected change is the second answer of every other trial. With `groups` the
    second half of the people has gains `steeper` by so much, and the second half of the trials is a
    session that is scored `later` points higher.
    """

    subjects: int
    repeats: int
    seed: int
    catches: bool = True
    both_orders: bool = True
    groups: bool = False
    steeper: float = -4.0
    later: float = 1.0
    noise: float = 0.15
    criterion: float = 0.15
    lean: float = 0.03
    bias: float = 2.5
    bias_sd: float = 1.0
    gain: float = 8.0
    gain_sd: float = 2.0
    noise_sd: float = 0.8


ANSWERED = {
    "9x5x1": Answering(
        subjects=9, repeats=1, seed=104, catches=False, both_orders=False, criterion=0.08
    ),
    "12x5x4": Answering(subjects=12, repeats=4, seed=105, groups=True),
    "20x5x8": Answering(subjects=20, repeats=8, seed=106),
}


def trials_of(name: str) -> Columns:
    """Return subject, condition, contrast and rating of each trial."""
    contrast = np.array(list(CONTRASTS.values()))
    study = STUDIES[name]
    if study is None:
        table = np.array([line.split() for line in TABLE_4.strip().splitlines()], dtype=float)
        subject, condition = np.indices(table.shape).reshape(2, -1)
        columns = [subject, condition, contrast[condition], table.ravel()]
    else:
        population, subjects, repeats, seed = study
        condition = np.repeat(np.arange(5), repeats)
        ratings = virtual_study(
            population,
            subjects=subjects,
            condition=condition,
            contrast=contrast[condition],
            rng=np.random.default_rng(seed),
        ).ratings
        columns = [ratings.subject, ratings.condition, ratings.contrast, ratings.rating]
    names = ["subject", "condition", "contrast", "rating"]
    return {name: column.tolist() for name, column in zip(names, columns, strict=True)}


def answers_of(people: Answering) -> Columns:
    """Return what each trial was, how it was answered and, if as expected, its rating, else NaN."""
    rng = np.random.default_rng(people.seed)
    contrast = np.round(list(CONTRASTS.values()), 3)
    once = np.append(contrast, 0.0) if people.catches else contrast
    size = len(once) * people.repeats
    number, subject = np.tile(np.arange(size), people.subjects), np.arange(people.subjects)
    subject = np.repeat(subject, size)
    # A catch trial stands for any of the conditions.
    place = number % len(once)
    condition, x = np.where(place < 5, place, number // len(once) % 5), once[place]
    first = (number + number // len(once)) % 2 == 0 if people.both_orders else number >= 0

    def one_each(middle: float, spread: float) -> FloatArray:
        return np.asarray(rng.normal(middle, spread, people.subjects))

    group = np.arange(people.subjects) * 2 // people.subjects if people.groups else 0 * subject
    session = number * 2 // size if people.groups else 0 * number
    criterion = people.criterion * np.exp(one_each(0.0, 0.2))
    bias, gain = one_each(people.bias, people.bias_sd), one_each(people.gain, people.gain_sd)
    if people.groups:
        gain += people.steeper * group
    felt = x + people.noise * rng.normal(size=len(x))
    lean = np.where(first, people.lean, -people.lean)
    above, beneath = criterion[subject] + lean, criterion[subject] - lean
    answer = np.select([felt > above, felt < -beneath], [1, -1], 0)
    score = bias[subject] + gain[subject] * felt + people.noise_sd * rng.normal(size=len(x))
    score = np.clip(np.round(score + people.later * session), 0, 10) + 0.0
    columns = {
        "subject": subject,
        "condition": condition,
        "contrast": x,
        "answer": answer,
        "first": first.astype(int),
        "catch": (x == 0).astype(int),
        "rating": np.where((answer == 1) & (x > 0), score, np.nan),
        "group": group[subject] if people.groups else group,
        "session": session,
    }
    return {name: column.tolist() for name, column in columns.items()}


def selection_of(columns: Columns, people: Answering) -> FloatArray:
    """Return the column that the model makes of all answers, of each trial."""
    of = {name: np.array(values) for name, values in columns.items()}
    ratings = Ratings(
        subjects=tuple(f"{number}" for number in range(people.subjects)),
        conditions=tuple(CONTRASTS),
        **{name: of[name] for name in ("subject", "condition", "contrast", "rating")},
    )
    stage = noticing_stage(
        Answered(
            ratings=ratings,
            answer=of["answer"],
            two_sided=np.ones(len(ratings.rating), dtype=np.bool_),
            first=of["first"] == 1,
            catch=of["catch"] == 1,
        )
    )
    assert isinstance(stage, NoticingStage), stage
    return np.round(stage.selection, 6)


def data_of(name: str) -> Columns:
    """Return the columns of one stage of an answered study that are kept and drawn from."""
    stage, study = name.split("_")
    people = ANSWERED[study]
    columns = answers_of(people)
    kept: tuple[str, ...] = ("subject", "condition", "contrast")
    if stage == "noticing":
        return {name: columns[name] for name in (*kept, "answer", "first", "catch")}
    kept += ("rating", "selection", *(("group", "session") if people.groups else ()))
    rated = ~np.isnan(columns["rating"])
    columns["selection"] = selection_of(columns, people).tolist()
    return {name: np.array(columns[name])[rated].tolist() for name in kept}


def log_sd(name: str, log_density: Any, log_unit: Any = 0.0) -> Any:
    """Return exp of a parameter with this log density, which is sampled in another unit."""
    log = log_unit + numpyro.sample(name, dist.ImproperUniform(dist.constraints.real, (), ()))
    numpyro.factor(f"{name}_prior", log_density(log))
    return jnp.exp(log)


def half_cauchy(log: Any) -> Any:
    return log - jnp.log1p(jnp.exp(2 * log))


def spread(log: Any) -> Any:
    return 2 * log - 1.5 * jnp.log1p(jnp.exp(2 * log))


def latent_model(data: dict[str, Any], centred: bool) -> None:
    """M2 in standard units: thresholds, population's line, subjects' lines, discrepancies."""
    sigma = log_sd("log_sigma", half_cauchy)
    tau = jnp.stack([log_sd("log_tau_bias", spread), log_sd("log_tau_gain", spread)])
    discrepancy_sd = log_sd("log_tau_discrepancy", half_cauchy)
    skew = numpyro.sample("z_rho", dist.ImproperUniform(dist.constraints.real, (), ()))
    numpyro.factor("rho_prior", -2 * jnp.log(jnp.cosh(skew)))
    rho = jnp.tanh(skew)
    root = jnp.array([[1.0, 0.0], [0.0, 0.0]]) + jnp.array([[0.0, 0.0], [1.0, 0.0]]) * rho
    root = tau[:, None] * (root + jnp.array([[0.0, 0.0], [0.0, 1.0]]) / jnp.cosh(skew))

    line = numpyro.sample("line", dist.Normal(0, WIDE).expand([2]).to_event(1))
    people, conditions = data["subjects"], data["conditions"]
    if centred:
        lines = dist.MultivariateNormal(jnp.zeros(2), scale_tril=root).expand([people]).to_event(1)
        own = numpyro.sample("own", lines)
        effects = numpyro.sample(
            "effects", dist.Normal(0, discrepancy_sd).expand([conditions]).to_event(1)
        )
    else:
        raw = numpyro.sample("raw", dist.Normal(0, 1).expand([people, 2]).to_event(2))
        own = raw @ root.T
        unit = numpyro.sample("unit", dist.Normal(0, 1).expand([conditions]).to_event(1))
        effects = unit * discrepancy_sd
    # Dirichlet(1, …, 1) gaps are thresholds that are uniform between the fixed ones, in order.
    edges = data["edges"]
    gaps = numpyro.sample("gaps", dist.Dirichlet(jnp.ones(len(edges) - 1)))
    free = edges[0] + (edges[-1] - edges[0]) * jnp.cumsum(gaps)[:-1]
    numpyro.factor("threshold_prior", -(((free - edges[1:-1]) / WIDE) ** 2).sum() / 2)
    far = jnp.array([1e4])
    every = jnp.concatenate([-far, edges[:1], free, edges[-1:], far])

    total = line + own
    location = (total[:, 0])[data["subject"]] + (total[:, 1])[data["subject"]] * data["x"]
    location = location + effects[data["condition"]]
    if data["columns"].shape[1]:
        of_columns = dist.Normal(0, data["column_sd"]).to_event(1)
        coefficients = numpyro.sample("coefficients", of_columns)
        location = location + data["columns"] @ coefficients
        numpyro.deterministic("of_columns", coefficients)
    lower = (every[data["category"]] - location) / sigma
    upper = (every[data["category"] + 1] - location) / sigma
    numpyro.factor("likelihood", data["weight"] @ log_between(lower, upper))

    numpyro.deterministic("sigma", sigma)
    numpyro.deterministic("tau", tau)
    numpyro.deterministic("tau_discrepancy", discrepancy_sd)
    numpyro.deterministic("group", line)
    numpyro.deterministic("lines", total)
    numpyro.deterministic("discrepancies", effects)
    numpyro.deterministic("bias_sd", bias_sd(tau, rho, data["turn"]))


def log_between(lower: Any, upper: Any) -> Any:
    """Return the log probability between two edges, hardly any if they are not in order."""
    mirrored = lower > 0
    high = log_ndtr(jnp.where(mirrored, -lower, upper))
    low = log_ndtr(jnp.where(mirrored, -upper, lower))
    return high + jnp.log(-jnp.expm1(jnp.minimum(low - high, -1e-300)))


def noticing_model(data: dict[str, Any]) -> None:
    """Each subject's d and criterion, the lean and the effects of conditions, with lapses.

    Few answers tell the noise so badly that all else, which is in SDs of it, may be large together.
    So d is sampled as sinh of a parameter, and all else in units of the root of 1 + d².
    """
    flat = dist.ImproperUniform(dist.constraints.real, (), ())
    bent, relative = numpyro.sample("bent_d", flat), numpyro.sample("relative_k", flat)
    middle, scale = jnp.sinh(bent), jnp.cosh(bent)
    group = jnp.stack([scale * relative, middle])
    numpyro.factor("group_prior", dist.Normal(1, WIDE).log_prob(group).sum() + 2 * jnp.log(scale))
    tau = jnp.stack([log_sd(name, spread, jnp.log(scale)) for name in ("log_tau_k", "log_tau_d")])
    effect_sd = log_sd("log_tau_effect", half_cauchy, jnp.log(scale))
    lean = numpyro.sample("lean", dist.Normal(0, 1))
    people, conditions = data["subjects"], data["conditions"]
    raw = numpyro.sample("raw", dist.Normal(0, 1).expand([people, 2]).to_event(2))
    own = numpyro.deterministic("lines", group + raw * tau)
    unit = numpyro.sample("unit", dist.Normal(0, 1).expand([conditions]).to_event(1))
    effects = numpyro.deterministic("effects", unit * effect_sd)
    numpyro.deterministic("group", group)
    criterion, d = own[data["subject"]].T
    place = d * data["x"] + jnp.sign(data["x"]) * effects[data["condition"]] - data["sign"] * lean
    expected, contrary, far = data["answer"] == 1, data["answer"] == -1, 1e4
    lower = jnp.where(contrary, -far, jnp.where(expected, criterion, -criterion) - place)
    upper = jnp.where(expected, far, jnp.where(contrary, -criterion, criterion) - place)
    log_p = jnp.log1p(-LAPSE) + log_between(lower, upper)
    numpyro.factor("likelihood", data["weight"] @ jnp.logaddexp(log_p, jnp.log(LAPSE / 3)))


def bias_sd(tau: Any, rho: Any, turn: float) -> Any:
    """Return the SD between subjects at contrast 0: of the intercept - turn * slope."""
    return jnp.sqrt(tau[0] ** 2 + (turn * tau[1]) ** 2 - 2 * turn * rho * tau[0] * tau[1])


def standardised(columns: Columns) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the distinct trials in standard units, with their number, and the units."""
    contrast, rating = np.array(columns["contrast"]), np.array(columns["rating"])
    units = {
        "x_mean": float(contrast.mean()),
        "x_sd": float(contrast.std()),
        "y_mean": float(rating.mean()),
        "y_sd": float(rating.std()),
    }
    values, category = np.unique(rating, return_inverse=True)
    x = (contrast - units["x_mean"]) / units["x_sd"]
    beside, column_sd = columns_beside(columns, x)
    rows = np.column_stack([columns["subject"], columns["condition"], x, category, beside])
    rows, weight = np.unique(rows, axis=0, return_counts=True)
    subject, condition, category = (rows[:, part].astype(int) for part in (0, 1, 3))
    edges = ((values[1:] + values[:-1]) / 2 - units["y_mean"]) / units["y_sd"]
    return {
        "subjects": int(subject.max()) + 1,
        "conditions": int(condition.max()) + 1,
        "subject": jnp.asarray(subject),
        "condition": jnp.asarray(condition),
        "category": jnp.asarray(category),
        "x": jnp.asarray(rows[:, 2]),
        "columns": jnp.asarray(rows[:, 4:]),
        "column_sd": jnp.asarray(column_sd),
        "weight": jnp.asarray(weight, dtype=float),
        "edges": jnp.asarray(edges),
        "turn": units["x_mean"] / units["x_sd"],
    }, units


def columns_beside(columns: Columns, x: FloatArray) -> tuple[FloatArray, list[float]]:
    """Return the columns of who noticed, group, group by contrast and session, and prior SDs.

    Of two groups or sessions, one is 1/√2 above their mean and the other as far below it.
    """
    beside: list[FloatArray] = []
    if "selection" in columns:
        beside.append(np.array(columns["selection"]))
    if "group" in columns:
        group, session = half_apart(columns["group"]), half_apart(columns["session"])
        beside += [group, group * x, session]
    sds = [SELECTION_SD, COLUMN_SD, COLUMN_SD, COLUMN_SD][: len(beside)]
    return (np.stack(beside, axis=-1) if beside else np.empty((len(x), 0))), sds


def half_apart(of: list[float]) -> FloatArray:
    return np.asarray((1 - 2 * np.array(of)) / 2**0.5)


def noticing_data(columns: Columns) -> dict[str, Any]:
    """Return the distinct trials in units of the SD of the contrasts, with their number."""
    contrast, catch = np.array(columns["contrast"]), np.array(columns["catch"]) == 1
    x, sign = contrast / contrast[~catch].std(), 2 * np.array(columns["first"]) - 1
    rows = np.stack([columns["subject"], columns["condition"], x, columns["answer"], sign], axis=-1)
    rows, weight = np.unique(rows, axis=0, return_counts=True)
    subject, condition, answer, sign = (rows[:, part].astype(int) for part in (0, 1, 3, 4))
    return {
        "subjects": int(subject.max()) + 1,
        "conditions": int(condition.max()) + 1,
        "subject": jnp.asarray(subject),
        "condition": jnp.asarray(condition),
        "x": jnp.asarray(rows[:, 2]),
        "answer": jnp.asarray(answer),
        "sign": jnp.asarray(sign),
        "weight": jnp.asarray(weight, dtype=float),
    }


def in_noise(drawn: Any) -> dict[str, FloatArray]:
    """Return draws (chains, draws) of what is kept of noticing, in SDs of the noise."""
    lines, group, effects = (np.asarray(drawn[name]) for name in ("lines", "group", "effects"))
    kept = {"d": group[..., 1], "criterion": group[..., 0], "lean": np.asarray(drawn["lean"])}
    for number in range(lines.shape[2]):
        kept[f"criterion {number}"], kept[f"d {number}"] = np.moveaxis(lines[:, :, number], -1, 0)
    return kept | {f"effect {number}": effects[..., number] for number in range(5)}


def of_answers(drawn: Any, data: dict[str, Any], units: dict[str, float]) -> dict[str, FloatArray]:
    """Return draws (chains, draws) of what is kept of ratings with columns, in rating points."""
    unit, per_contrast = units["y_sd"], units["y_sd"] / units["x_sd"]
    lines, group = np.asarray(drawn["lines"]), np.asarray(drawn["group"])
    beside = np.asarray(drawn["of_columns"])
    kept = {"selection": beside[..., 0] * unit}
    if beside.shape[-1] > 1:
        half = np.array([1.0, -1.0]) / 2**0.5
        by_group = group[:, :, None] + half[:, None] * beside[:, :, None, 1:3]
        for number in range(2):
            level, gain = np.moveaxis(by_group[:, :, number], -1, 0)
            kept[f"level of group {number}"] = units["y_mean"] + unit * level
            kept[f"gain of group {number}"] = per_contrast * gain
        apart = by_group[:, :, 0] - by_group[:, :, 1]
        kept["levels apart"], kept["gains apart"] = (
            apart[..., 0] * unit,
            apart[..., 1] * per_contrast,
        )
        lines = lines + half[np.asarray(data["groups"])][:, None] * beside[:, :, None, 1:3]
    kept["group_level"] = units["y_mean"] + unit * group[..., 0]
    for number in range(lines.shape[2]):
        kept[f"level {number}"] = units["y_mean"] + unit * lines[:, :, number, 0]
    told = in_rating_points(drawn | {"lines": lines}, units)
    others = ("residual_sd", "discrepancy_sd", "bias_sd")
    return kept | {name: values for name, values in told.items() if name not in others}


def in_rating_points(drawn: Any, units: dict[str, float]) -> dict[str, FloatArray]:
    """Return draws (chains, draws) of every quantity that is kept."""
    unit, turn = units["y_sd"], units["x_mean"] / units["x_sd"]
    lines, group = np.asarray(drawn["lines"]), np.asarray(drawn["group"])
    gains = lines[..., 1] * unit / units["x_sd"]
    kept = {
        "residual_sd": np.asarray(drawn["sigma"]) * unit,
        "discrepancy_sd": np.asarray(drawn["tau_discrepancy"]) * unit,
        "gain_sd": np.asarray(drawn["tau"])[..., 1] * unit / units["x_sd"],
        "bias_sd": np.asarray(drawn["bias_sd"]) * unit,
        "group_gain": group[..., 1] * unit / units["x_sd"],
        "group_bias": units["y_mean"] + unit * (group[..., 0] - turn * group[..., 1]),
    }
    for number in range(lines.shape[2]):
        own = lines[:, :, number]
        kept[f"bias {number}"] = units["y_mean"] + unit * (own[..., 0] - turn * own[..., 1])
        kept[f"gain {number}"] = gains[..., number]
        kept[f"relative_gain {number}"] = gains[..., number] - gains.mean(axis=-1)
    effects = np.asarray(drawn["discrepancies"]) * unit
    return kept | {f"discrepancy {number}": effects[..., number] for number in range(5)}


def summary(draws: FloatArray) -> dict[str, float]:
    """Return mean, SD, 95% limits and convergence of draws (chains, draws)."""
    low, high = np.quantile(draws, [0.025, 0.975])
    found = {
        "mean": draws.mean(),
        "sd": draws.std(),
        "low": low,
        "high": high,
        "r_hat": gelman_rubin(draws),
        "ess": effective_sample_size(draws),
    }
    return {name: float(f"{float(value):.6g}") for name, value in found.items()}


def sampled(
    model: Callable[..., None], data: dict[str, Any], run: Run, start: Any, *options: bool
) -> tuple[Any, dict[str, int]]:
    """Return the draws of a model, by chain, and how they were drawn."""
    kernel = NUTS(
        model,
        dense_mass=True,
        target_accept_prob=0.95,
        max_tree_depth=run.depth,
        init_strategy=init_to_value(values=start),
    )
    chains = MCMC(
        kernel,
        num_warmup=run.warm_up,
        num_samples=run.draws,
        num_chains=CHAINS,
        chain_method="vectorized",
        progress_bar=False,
    )
    chains.run(jax.random.PRNGKey(SEED), data, *options, extra_fields=("diverging",))
    return chains.get_samples(group_by_chain=True), {
        "chains": CHAINS,
        "warm_up": run.warm_up,
        "draws": run.draws,
        "seed": SEED,
        "diverging": int(chains.get_extra_fields()["diverging"].sum()),
    }


def drawn_noticing(columns: Columns, run: Run) -> tuple[dict[str, FloatArray], dict[str, int]]:
    """Return draws of what is kept of noticing, and how they were drawn."""
    logs = {"log_tau_k": -1.0, "log_tau_d": -1.0, "log_tau_effect": -1.5}
    start = logs | {"bent_d": 1.0, "relative_k": 0.7, "lean": 0.0}
    drawn, how = sampled(noticing_model, noticing_data(columns), run, start)
    return in_noise(drawn), how


def drawn_rating(
    columns: Columns, run: Run, *, centred: bool
) -> tuple[dict[str, FloatArray], dict[str, int]]:
    """Return draws of what is kept of ratings, and how they were drawn."""
    data, units = standardised(columns)
    start = {
        "log_sigma": -0.5,
        "log_tau_bias": -0.7,
        "log_tau_gain": -0.7,
        "log_tau_discrepancy": -1.5,
        "z_rho": 0.0,
        "gaps": jnp.diff(data["edges"]) / (data["edges"][-1] - data["edges"][0]),
    }
    if "selection" in columns:
        start["coefficients"] = jnp.zeros(data["columns"].shape[1])
    drawn, how = sampled(latent_model, data, run, start, centred)
    if "selection" not in columns:
        return in_rating_points(drawn, units), how
    if "group" in columns:
        of_subjects = dict(zip(columns["subject"], columns["group"], strict=True))
        data["groups"] = [int(of_subjects[number]) for number in range(data["subjects"])]
    return of_answers(drawn, data, units), how


def simulated(name: str) -> dict[str, Any] | None:
    """Return of which people and with which seed a study is, None of the published table."""
    if name not in STUDIES:
        return vars(ANSWERED[name.split("_")[1]])
    population = STUDIES[name]
    if population is None:
        return None
    people, subjects, repeats, seed = population
    return {"population": vars(people), "subjects": subjects, "repeats": repeats, "seed": seed}


def main(name: str) -> None:
    """Draw the posterior of the study and write it beside this file."""
    numpyro.enable_x64()
    columns = trials_of(name) if name in STUDIES else data_of(name)
    run = RUNS.get(name, Run())
    if name.startswith("noticing"):
        kept, how = drawn_noticing(columns, run)
    else:
        kept, how = drawn_rating(columns, run, centred=name in CENTRED)
    posterior = {key: summary(values) for key, values in kept.items()}
    result = {
        "study": name,
        "simulated": simulated(name),
        "program": {package: version(package) for package in ("numpyro", "jax", "numpy")}
        | {"python": sys.version.split()[0]},
        "run": how,
        "data": columns,
        "posterior": posterior,
    }
    (HERE / f"{name}.json").write_text(json.dumps(result, indent=None) + "\n", encoding="utf-8")
    worst = max(row["r_hat"] for row in posterior.values())
    least = min(row["ess"] for row in posterior.values())
    print(f"{name}: R-hat up to {worst:.4f}, ESS from {least:.0f}", how)


if __name__ == "__main__":
    for study in sys.argv[1:]:
        main(study)
