"""People left out for false alarms count where it is tested whether changes are noticed."""

import numpy as np

from analysis.loading.study_data import StudyData
from analysis.simulation import Simulation
from analysis.statistics.detection import Detection, noticed_p
from analysis.trials.trial_statistics import TrialStatistics
from device.people.person import DEFAULT, Population
from protocol.study.rules import Exclusions
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.analysis.simulated_data import simulated_data

# They report a change in half of all trials, whatever there is.
NUMB = Population(
    typical=DEFAULT.typical.__class__(skin=0.0, gain=0.0, criterion=0.074, criterion_less=0.074),
)


def study(most: float | None) -> Study:
    found = parsed_study(template("extended"))
    return found.model_copy(update={"exclusions": Exclusions(max_false_alarms=most)})


def noticed(data: StudyData, asked: Study) -> Detection:
    whole = TrialStatistics(data=data, study=asked).noticed[-1].found
    assert isinstance(whole, Detection)
    return whole


def test_who_reports_too_much_counts_for_noticing_alone() -> None:
    strict, lenient = study(0.5), study(None)
    left, whole = (
        simulated_data(Simulation(study=each, population=NUMB), 12, "alarms")
        for each in (strict, lenient)
    )
    assert 0 < left.alarmed < 12
    assert whole.alarmed == 0
    assert len(left.table.subjects) == 12 - left.alarmed
    assert left.of_noticing["participant"].nunique() == 12
    assert noticed(left, strict) == noticed(whole, lenient)


def test_nobody_is_found_to_notice_what_nobody_feels() -> None:
    simulation = Simulation(study=study(0.5), population=NUMB)
    tables, _ = simulation.studies(12, *(f"nobody/{number}" for number in range(120)))
    signal, catch = tables.noticed[:, :, :-1].sum(axis=2), tables.noticed[:, :, -1]
    p = noticed_p(signal, catch)
    assert np.mean(p < 0.05) < 0.05 + 2 * np.sqrt(0.05 * 0.95 / 120)
    # The rule leaves out some people of nearly every cohort.
    left = (~np.isnan(tables.responses)).any(axis=2).sum(axis=1)
    assert np.mean(left < 12) > 0.8
