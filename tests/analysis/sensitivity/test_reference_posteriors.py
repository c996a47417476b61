"""M2 against posteriors that NUTS drew from the same model (see reference/sample_posteriors.py)."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.estimates import FloatArray, Interval
from analysis.sensitivity.integration import WeightedPoints
from analysis.sensitivity.latent_posterior import LatentPosterior
from analysis.sensitivity.lines import Ratings, spread_at
from analysis.sensitivity.ordinal_model import (
    OrdinalSensitivity,
    PreparedTrials,
    posterior_of,
    prepared_ratings,
)

REFERENCE = Path(__file__).parent / "reference"
STUDIES = ("table_4", "middle_9x5x1", "ceiling_9x5x4", "off_the_line_20x5x8")
# Largest departure of a limit, in widths of the reference's interval.
LARGEST = 0.05
Fit = tuple[PreparedTrials, LatentPosterior, OrdinalSensitivity]


@cache
def reference(study: str) -> dict[str, Any]:
    kept: dict[str, Any] = json.loads((REFERENCE / f"{study}.json").read_text(encoding="utf-8"))
    return kept


@cache
def fit(study: str) -> Fit:
    ready = prepared(study)
    posterior = posterior_of(ready)
    assert isinstance(posterior.fit, OrdinalSensitivity)
    return ready, posterior.latent, posterior.fit


def prepared(study: str) -> PreparedTrials:
    columns = {name: np.array(values) for name, values in reference(study)["data"].items()}
    subjects, conditions = columns["subject"].max() + 1, columns["condition"].max() + 1
    ready = prepared_ratings(
        Ratings(
            subjects=tuple(f"{number}" for number in range(subjects)),
            conditions=tuple(f"{number}" for number in range(conditions)),
            **columns,
        )
    )
    assert isinstance(ready, PreparedTrials)
    return ready


def limits(study: str) -> dict[str, Interval]:
    """The 95% limits of every quantity that the reference has."""
    ready, posterior, result = fit(study)
    points = posterior.points
    lines = result.lines
    found = {
        "residual_sd": of_component(ready, points, 0),
        "discrepancy_sd": of_component(ready, points, 4),
        # That of gains which differ: the reference knows no others.
        "gain_sd": interval(points, lambda at: spread_at(at, ready.axes)[:, 1]),
        "bias_sd": lines.bias_sd_interval,
        "group_gain": lines.gain_interval,
        "group_bias": lines.bias_interval,
    }
    for row, line in enumerate(lines.subjects):
        found |= {f"bias {row}": line.bias_interval, f"gain {row}": line.gain_interval}
        found[f"relative_gain {row}"] = line.relative_gain_interval
    for name, estimate in result.discrepancies.items():
        found[f"discrepancy {name}"] = estimate.interval
    return found


def of_component(ready: PreparedTrials, points: WeightedPoints, column: int) -> Interval:
    """The 95% interval of the SD of which a column has the logarithm."""
    return interval(points, lambda at: ready.axes.y_sd * np.exp(at[:, column]))


def interval(points: WeightedPoints, of: Callable[[FloatArray], FloatArray]) -> Interval:
    low, high = points.quantiles(of, 0.025, 0.975)
    return low, high


def departures(study: str) -> dict[str, float]:
    """The larger departure of the two limits from the reference, in widths of its interval."""
    found, kept = limits(study), reference(study)["posterior"]
    assert set(found) == set(kept)
    return {name: departure(ends, kept[name]) for name, ends in found.items()}


def departure(found: Interval, kept: dict[str, float]) -> float:
    low, high = kept["low"], kept["high"]
    return max(abs(found[0] - low), abs(found[1] - high)) / (high - low)


@pytest.mark.parametrize("study", STUDIES)
def test_limits_are_those_of_the_full_posterior(study: str) -> None:
    assert {name: share for name, share in departures(study).items() if share > LARGEST} == {}


@pytest.mark.parametrize("study", STUDIES)
def test_the_integration_has_enough_effective_points(study: str) -> None:
    assert fit(study)[2].effective_points >= 200


@pytest.mark.parametrize("study", STUDIES)
def test_the_reference_has_converged(study: str) -> None:
    rows = reference(study)["posterior"].values()
    assert max(row["r_hat"] for row in rows) < 1.005
    assert min(row["ess"] for row in rows) > 2000
