"""How often the hypothesis that gains differ is supported, where they do and where they do not."""

import numpy as np
import pytest

from analysis.estimates import NotEstimable
from analysis.sensitivity.answers_model import UNEQUAL
from analysis.sensitivity.rating_stage import Beside, rating_stage
from tests.analysis.sensitivity.simulated_raters import VirtualPopulation, virtual_study

pytestmark = pytest.mark.soak


def supported(
    studies: int, people: VirtualPopulation, subjects: int, conditions: int, times: int
) -> float:
    """The share of studies whose probability of equal gains is below the level."""
    condition = np.tile(np.arange(conditions), times)
    contrast = np.linspace(0.1, 0.7, conditions)[condition]
    verdicts = []
    for seed in range(studies):
        rng = np.random.default_rng([7, seed])
        study = virtual_study(
            people, subjects=subjects, condition=condition, contrast=contrast, rng=rng
        )
        fit = rating_stage(study.ratings, Beside())
        assert not isinstance(fit, NotEstimable)
        verdicts.append(fit.equal_gains < UNEQUAL)
    share = float(np.mean(verdicts))
    print(f"{subjects} x {conditions} x {times}, {people.gain_sd}: {share:.3f}")
    return share


@pytest.mark.parametrize(
    ("studies", "gain", "bias", "design"),
    [
        (200, 6.0, 4.0, (9, 5, 1)),
        (150, 6.0, 4.0, (20, 5, 4)),
        (150, 0.0, 4.0, (12, 12, 2)),
        (150, 10.0, 5.0, (20, 5, 4)),
    ],
)
def test_equal_gains_are_said_to_differ_in_5_percent_of_studies_at_most(
    studies: int, gain: float, bias: float, design: tuple[int, int, int]
) -> None:
    people = VirtualPopulation(bias=bias, gain=gain, gain_sd=0, discrepancy_sd=0.5, noise_sd=1)
    assert supported(studies, people, *design) <= 0.05


@pytest.mark.parametrize(
    ("gain_sd", "design", "share"), [(2.0, (20, 5, 4), 0.8), (3.0, (9, 5, 1), 0.17)]
)
def test_gains_that_differ_are_found_where_the_data_tell(
    gain_sd: float, design: tuple[int, int, int], share: float
) -> None:
    people = VirtualPopulation(bias=4, gain=6, gain_sd=gain_sd, discrepancy_sd=0.5, noise_sd=1)
    assert supported(60, people, *design) == pytest.approx(share, abs=0.1)
