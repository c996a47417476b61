"""A simulated cohort answers as the sessions of its seed: link, device, journal and loading."""

import re
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.loading.study_data import StudyData
from analysis.simulation import Simulation
from device.people.person import DEFAULT, Population
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from protocol.study_file.loading import parsed_study, template
from tests.analysis.simulated_data import simulated_data
from tests.protocol.studies import unasked
from tests.system.in_process_sessions import loaded_rehearsals

GIVEN = [
    *("participant", "trial_index", "trial_kind", "condition", "question", "expected", "level"),
    *("opposite", "change", "agrees", "score", "score_reaction_time_s"),
]
"""What participants answer, and to what."""


def answers(data: StudyData) -> pd.DataFrame:
    trials = data.trials[GIVEN].astype(object)
    return trials.where(trials.notna(), None).reset_index(drop=True)


def different(folder: Path, text: str, people: int, seed: int) -> list[tuple[Any, Any]]:
    """The trials that the sessions and the simulation do not answer alike, with both answers.

    Nobody is left out: the rules are tested elsewhere.
    """
    study = parsed_study(text)
    study = study.model_copy(update={"exclusions": type(study.exclusions)()})
    whole = answers(loaded_rehearsals(folder, text, people, seed, rules=study.exclusions))
    world = SimulatedBeam(seed).world
    fast = answers(simulated_data(Simulation(study=study, world=world), people, seed))
    assert len(whole) == len(fast) > 0
    rows = zip(whole.to_numpy(), fast.to_numpy(), strict=True)
    return [(one.tolist(), other.tolist()) for one, other in rows if (one != other).any()]


@pytest.mark.parametrize(("name", "people"), [("paper", 10), ("extended", 1)])
def test_the_simulation_answers_as_the_sessions_do(tmp_path: Path, name: str, people: int) -> None:
    assert different(tmp_path, template(name), people, seed=7) == []


def test_the_simulation_rates_as_the_sessions_do(tmp_path: Path) -> None:
    scale = "[rating]\nminimum = -30\nmaximum = 30\n\n["
    text = re.sub(r"(?s)\[rating\].*?\n\[", scale, unasked(template("extended")), count=1)
    assert different(tmp_path, text, people=2, seed=7) == []


def test_somebody_who_leaves_does_so_at_the_same_question(tmp_path: Path) -> None:
    typical = DEFAULT.typical
    people = Population(
        typical=type(typical)(**{**vars(typical), "dropout": 0.3}), varied=DEFAULT.varied
    )
    whole = loaded_rehearsals(tmp_path, template("paper"), 4, 1, population=people)
    world = SimulatedBeam(1).world
    fast = Simulation(study=parsed_study(template("paper")), population=people, world=world)
    found = simulated_data(fast, 4, 1)
    assert whole.unfinished == found.unfinished != ()
    assert answers(whole).equals(answers(found))


@pytest.mark.soak
def test_of_a_thousand_trials_at_most_one_differs(tmp_path: Path) -> None:
    found = different(tmp_path, template("extended"), 40, seed=1)
    print(f"\n{len(found)} of {40 * 29} trials differ: {found}")
    assert len(found) <= 1
