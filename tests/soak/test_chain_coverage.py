"""From physics over a virtual finger to gains: intervals cover those that people have."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from analysis.loading.study_data import StudyData
from analysis.sensitivity.answers_model import Rated, sensitivity
from analysis.simulation import Simulation
from analysis.trials.contrasts import trial_contrasts
from analysis.trials.study_answers import study_answers
from device.friction.changes import LAW
from device.people.person import Normal, Person, Population
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.analysis.simulated_data import simulated_data
from tests.system.in_process_sessions import loaded_rehearsals

pytestmark = pytest.mark.soak

TEXT = template("extended").replace('score_when = "agrees"', 'score_when = "always"')
STUDY = parsed_study(TEXT)
PEOPLE = Population(
    typical=Person(felt_noise=0.02, criterion=0.02, criterion_less=0.02),
    varied={"bias": Normal(mean=5.0, sd=1.0), "gain": Normal(mean=6.0, sd=2.0)},
)
"""They score along a line, as the model assumes."""
LEAST = 0.93


def covered(data: StudyData, study: Study) -> Iterator[bool]:
    """Whether the 95% interval holds the true gain, for each participant."""
    contrast = trial_contrasts(study, data.trials, data.touches).by_law[LAW]
    found = sensitivity(study_answers(study, data, contrast, study.rating)).rating
    assert isinstance(found, Rated), found
    for person in found.subjects:
        low, high = person.gain.interval
        yield low <= data.virtual[person.subject].sensitivity <= high


def share(found: list[bool], path: str) -> float:
    print(f"\nThe model covers {np.mean(found):.3f} of {len(found)} gains in the {path} path")
    return float(np.mean(found)) + 2 * float(np.sqrt(LEAST * (1 - LEAST) / len(found)))


def test_thirty_sessions(tmp_path: Path) -> None:
    data = loaded_rehearsals(tmp_path, TEXT, 30, seed=1, population=PEOPLE)
    assert share(list(covered(data, STUDY)), "full") >= LEAST


def test_a_thousand_simulated_studies() -> None:
    simulation = Simulation(study=STUDY, population=PEOPLE)
    found = [
        within
        for seed in range(1000)
        for within in covered(simulated_data(simulation, 9, f"coverage/{seed}"), STUDY)
    ]
    assert share(found, "fast") >= LEAST
