"""Coverage of the 95% intervals of d′, criterion and rates in studies with virtual people."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.special import ndtri

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.simulation import PlannedTrials, cohort, noticed_counts
from analysis.statistics.detection import Detection, detection
from device.people.person import DEFAULT, World, people_of, person_name, session_name
from protocol.study.rules import Exclusions
from protocol.study_file.loading import parsed_study, template

STUDIES, PEOPLE, AGAIN = 500, 12, 60
"""A person's true rates are those of so many sessions of the same person."""
AT_ONCE = 60

pytestmark = pytest.mark.soak


def counted(planned: PlannedTrials, names: Sequence[str], sessions: int, key: str) -> IntArray:
    """Reported changes and trials, shape (sessions, people, conditions + 1, 2)."""
    slots = np.arange(len(names)) % PEOPLE
    people = people_of(DEFAULT, names)
    return np.array(
        [
            noticed_counts(
                planned,
                cohort(
                    planned,
                    people,
                    [session_name(f"{key}{again}", name, 1) for name in names],
                    # Each session another order, so that a rate is none of a single order.
                    slots if sessions == 1 else (slots + again) % PEOPLE,
                    World(),
                ),
            )
            for again in range(sessions)
        ]
    )


def ends(found: Detection) -> FloatArray:
    rates = found.hits.share_interval, found.false_alarms.share_interval
    assert not isinstance(found.d_prime_interval, NotEstimable)
    assert not isinstance(found.criterion_interval, NotEstimable)
    return np.array([*rates, found.d_prime_interval, found.criterion_interval])


def truth(hit: FloatArray, alarm: FloatArray) -> FloatArray:
    z_hit, z_alarm = ndtri(hit), ndtri(alarm)
    return np.stack([hit, alarm, z_hit - z_alarm, -(z_hit + z_alarm) / 2], axis=-1)


def test_the_intervals_cover_the_truth_in_95_of_100_studies() -> None:
    # Rules that leave out who reports much on catch trials would change what is to be covered.
    study = parsed_study(template("extended")).model_copy(update={"exclusions": Exclusions()})
    planned = PlannedTrials(study=study)
    own, group, rates, studies = [], [], [], []
    for first in range(0, STUDIES, AT_ONCE):
        numbers = range(first, min(first + AT_ONCE, STUDIES))
        names = [person_name(f"study {n}", f"P{who:02d}") for n in numbers for who in range(PEOPLE)]
        shape = (len(numbers), PEOPLE, -1, 2)
        studies += list(counted(planned, names, 1, "once")[0].reshape(shape))
        often = counted(planned, names, AGAIN, "again").sum(axis=0).reshape(shape)
        rates += list((often[..., 0] + 0.5) / (often[..., 1] + 1))
    people = np.array(rates)  # (studies, people, conditions + 1)
    average = people.mean(axis=(0, 1))
    for study_number, counts in enumerate(studies):
        alarms = counts[:, -1]
        for condition in range(len(study.conditions)):
            found = detection(counts[:, condition], alarms)
            assert isinstance(found, Detection)
            low, high = ends(found).T
            true = truth(average[condition], average[-1])
            group.append((low <= true) & (true <= high))
        mine = people[study_number]
        for who in range(PEOPLE):
            found = detection(counts[None, who, :-1].sum(axis=1), alarms[None, who])
            if not isinstance(found, Detection):  # who left before the first catch trial
                continue
            low, high = ends(found).T
            true = truth(mine[who, :-1].mean(), mine[who, -1])
            own.append((low <= true) & (true <= high))
    for name, covered in (("conditions", group), ("people", own)):
        share = np.mean(covered, axis=0)
        print(name, "hits, false alarms, d′, criterion:", np.round(share, 3))
        assert ((share[2:] >= 0.93) & (share[2:] <= 0.97)).all()
        # A person's trials are of several conditions, so that their rate varies less than that of
        # equal trials, which the interval supposes.
        assert ((share[:2] >= 0.93) & (share[:2] <= 0.985)).all()
