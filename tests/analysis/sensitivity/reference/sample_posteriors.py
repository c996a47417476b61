"""Draws the reference posteriors of M2 that are kept beside this file, by NUTS.

No test runs this program, and `make test` does not install what it needs (numpyro). To draw again:
`python -m venv V && V/bin/pip install numpyro`, then, from the root of the repository,
`V/bin/python -m tests.analysis.sensitivity.reference.sample_posteriors NAME` for one of STUDIES.
It shares no code with the model that the tests compare with it.
"""

import json
import sys
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

from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study

HERE = Path(__file__).parent
CHAINS, WARM_UP, SEED = 4, 2000, 20
WIDE = 10.0
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
DRAWS = {"table_4": 10000, "middle_9x5x1": 30000, "ceiling_9x5x4": 30000}
FEWEST_DRAWS = 5000
Columns = dict[str, list[float]]
FloatArray = NDArray[np.float64]


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


def log_sd(name: str, log_density: Any) -> Any:
    """Return exp of a parameter with this log density."""
    log = numpyro.sample(name, dist.ImproperUniform(dist.constraints.real, (), ()))
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
    lower = (every[data["category"]] - location) / sigma
    upper = (every[data["category"] + 1] - location) / sigma
    mirrored = lower > 0
    high = log_ndtr(jnp.where(mirrored, -lower, upper))
    low = log_ndtr(jnp.where(mirrored, -upper, lower))
    log_p = high + jnp.log(-jnp.expm1(jnp.minimum(low - high, -1e-300)))
    numpyro.factor("likelihood", data["weight"] @ log_p)

    numpyro.deterministic("sigma", sigma)
    numpyro.deterministic("tau", tau)
    numpyro.deterministic("tau_discrepancy", discrepancy_sd)
    numpyro.deterministic("group", line)
    numpyro.deterministic("lines", total)
    numpyro.deterministic("discrepancies", effects)
    numpyro.deterministic("bias_sd", bias_sd(tau, rho, data["turn"]))


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
    rows = np.stack([columns["subject"], columns["condition"], x, category], axis=-1)
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
        "weight": jnp.asarray(weight, dtype=float),
        "edges": jnp.asarray(edges),
        "turn": units["x_mean"] / units["x_sd"],
    }, units


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


def main(name: str) -> None:
    """Draw the posterior of the study and write it beside this file."""
    numpyro.enable_x64()
    columns = trials_of(name)
    data, units = standardised(columns)
    draws = DRAWS.get(name, FEWEST_DRAWS)
    start = {
        "log_sigma": -0.5,
        "log_tau_bias": -0.7,
        "log_tau_gain": -0.7,
        "log_tau_discrepancy": -1.5,
        "z_rho": 0.0,
        "gaps": jnp.diff(data["edges"]) / (data["edges"][-1] - data["edges"][0]),
    }
    kernel = NUTS(
        latent_model,
        dense_mass=True,
        target_accept_prob=0.95,
        init_strategy=init_to_value(values=start),
    )
    chains = MCMC(
        kernel,
        num_warmup=WARM_UP,
        num_samples=draws,
        num_chains=CHAINS,
        chain_method="sequential",
        progress_bar=False,
    )
    chains.run(
        jax.random.PRNGKey(SEED), data, name == "off_the_line_20x5x8", extra_fields=("diverging",)
    )
    drawn = chains.get_samples(group_by_chain=True)
    kept = {key: summary(values) for key, values in in_rating_points(drawn, units).items()}
    population = STUDIES[name]
    result = {
        "study": name,
        "simulated": None
        if population is None
        else {
            "population": vars(population[0]),
            "subjects": population[1],
            "repeats": population[2],
            "seed": population[3],
        },
        "program": {package: version(package) for package in ("numpyro", "jax", "numpy")}
        | {"python": sys.version.split()[0]},
        "run": {
            "chains": CHAINS,
            "warm_up": WARM_UP,
            "draws": draws,
            "seed": SEED,
            "diverging": int(chains.get_extra_fields()["diverging"].sum()),
        },
        "data": columns,
        "posterior": kept,
    }
    (HERE / f"{name}.json").write_text(json.dumps(result, indent=None) + "\n", encoding="utf-8")
    worst = max(kept.values(), key=lambda row: row["r_hat"])["r_hat"]
    least = min(row["ess"] for row in kept.values())
    print(f"{name}: R-hat up to {worst:.4f}, ESS from {least:.0f}", result["run"])


if __name__ == "__main__":
    main(sys.argv[1])
