"""The forecast of precision against the intervals of M2 on simulated studies."""

from typing import NamedTuple

import numpy as np
import pytest

from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from protocol.preview.preview import Cohort, relative_gain_half_width
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study

CONTRASTS = np.array([0.276, 0.103, 0.347, 0.451, 0.065])
"""Of the paper's conditions on the top rung."""


class Design(NamedTuple):
    participants: int
    levels: tuple[float, ...]


DESIGNS = {
    "9x5x1": Design(9, (1.0,)),
    "9x5x4": Design(9, (1.0,) * 4),
    "20x5x8": Design(20, (1.0,) * 8),
    "9x5x4 with levels": Design(9, (0.25, 0.5, 1.0, 1.5)),
}


def forecast_and_intervals(design: Design, sds: tuple[float, float, float], studies: int) -> float:
    """The forecast half-width of a relative gain, as a multiple of M2's mean one."""
    residual_sd, off_the_line_sd, gain_sd = sds
    contrast = np.outer(CONTRASTS, design.levels)
    population = VirtualPopulation(
        bias=3.0,
        bias_sd=0.7,
        gain=6.0,
        gain_sd=gain_sd,
        discrepancy_sd=off_the_line_sd,
        noise_sd=residual_sd,
    )
    halves = []
    for seed in range(studies):
        study = virtual_study(
            population,
            subjects=design.participants,
            condition=np.repeat(np.arange(5), contrast.shape[1]),
            contrast=contrast.ravel(),
            rng=np.random.default_rng([7, seed]),
        )
        found = ordinal_sensitivity(study.ratings)
        assert isinstance(found, OrdinalSensitivity)
        intervals = [line.relative_gain_interval for line in found.lines.subjects]
        halves.append(np.diff(intervals).mean() / 2)
    people = Cohort(
        participants=design.participants,
        residual_sd=residual_sd,
        off_the_line_sd=off_the_line_sd,
        gain_sd=gain_sd,
    )
    own = {f"{row}": list(values) for row, values in enumerate(contrast)}
    ratio = relative_gain_half_width(own, 1.0, people) / float(np.mean(halves))
    print(f"\n{design} {sds}: {ratio:.3f} times the intervals of {studies} studies")
    return ratio


@pytest.mark.parametrize("design", DESIGNS)
def test_the_forecast_is_within_15_percent_of_what_m2_reports(design: str) -> None:
    ratio = forecast_and_intervals(DESIGNS[design], (1.48, 1.8, 4.1), studies=8)
    assert ratio == pytest.approx(1, abs=0.15)


@pytest.mark.soak
@pytest.mark.parametrize("sds", [(1.48, 1.8, 4.1), (1.0, 0.5, 2.0), (1.0, 0.0, 2.0)])
@pytest.mark.parametrize("design", DESIGNS)
def test_the_forecast_holds_for_other_raters(design: str, sds: tuple[float, float, float]) -> None:
    assert forecast_and_intervals(DESIGNS[design], sds, studies=100) == pytest.approx(1, abs=0.15)
