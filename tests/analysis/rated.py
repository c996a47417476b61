"""A study whose conditions have no question: what is felt is scored at once, from 1 to 7."""

from functools import cache

import numpy as np

from analysis.loading.study_data import StudyData, load_study_data
from analysis.report.report import Report, report
from protocol.journal.events import Answered, StoredEvent
from protocol.journal.records import PlannedTrial
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study
from tests.analysis.chains import answer, chain
from tests.analysis.reports import ORIGIN, session_events

_CONDITION = """
[[condition]]
name = "{volts} V"
touches = [{{ place = "smooth", voltage_v = {volts} }}]
"""
TEXT = """
[study]
name = "how rough"

[rig]
device = "sim"
voltages_are = "peak"
nominal_resonance_hz = 24221

[design]
participants = 8
repeats = 3
catch_trials = 3
order = "williams"

[rating]
minimum = 1
maximum = 7
bands = [
  {{ from = 1, to = 3, en = "smooth", zh = "光滑" }},
  {{ from = 4, to = 7, en = "rough", zh = "粗糙" }},
]
{groups}
""" + "".join(_CONDITION.replace("{volts}", str(volts)) for volts in (20, 60, 100, 160))
_GROUPS = """
[[group]]
name = "young"
size = 4

[[group]]
name = "old"
size = 4
"""


def rated_study(*, groups: bool = False) -> Study:
    """The study, of two groups if asked."""
    return parsed_study(TEXT.format(groups=_GROUPS * groups))


RATED = rated_study()


def rated_cohort(
    study: Study = RATED, people: int = 8, *, gain: float = 4.0, rest: float = 6.0, seed: int = 3
) -> list[list[StoredEvent]]:
    """Sessions of people who give about `rest` without a drive, and `gain` less at 160 V."""
    rng = np.random.default_rng(seed)
    sessions = []
    for slot in range(people):
        own = rng.normal(rest, 0.4)

        def rate(trial: PlannedTrial, own: float = own) -> Answered:
            volts = trial.touches[-1]["voltage_v"]
            wanted = own - gain * (volts / 160) ** 2 + rng.normal(0.0, 0.5)
            score = round(float(np.clip(wanted, study.rating.minimum, study.rating.maximum)))
            seconds = round(float(rng.uniform(0.4, 2.0)), 3)
            return answer(trial, score, reaction_time_s=seconds)

        sessions.append(chain(session_events(study, slot, rng, measured=False, rate=rate)))
    return sessions


@cache
def rated_data() -> StudyData:
    """The scores of the study."""
    return load_study_data(rated_cohort(), rehearsals=False, rules=RATED.exclusions)


@cache
def rated_report() -> Report:
    """The report on it."""
    return report("How rough", rated_data(), RATED, ORIGIN)
