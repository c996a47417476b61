"""Sessions of tracks that nobody played, of people whose thresholds are known."""

from collections import defaultdict
from dataclasses import replace

import numpy as np

from device.tracks.next_level import next_level
from protocol.journal.events import (
    DeviceArmed,
    DeviceOff,
    Event,
    ResonanceMeasured,
    SessionCompleted,
    StoredEvent,
    TrialStarted,
)
from protocol.journal.records import PlannedTrial, TrackAnswer
from protocol.plan.plan import plan
from protocol.plan.trials import planned_trial
from protocol.study.study import Study
from protocol.study.track import GUESS_RATE, Track
from protocol.study_file.loading import parsed_study
from protocol.study_file.loading import template as text_of
from protocol.tracks.procedure import Answer, constant_order
from tests.analysis.chains import answer, chain, opened
from tests.analysis.reports import touched

BOTH = text_of("threshold")
TRACKS = BOTH.partition("# Scored beside")[0]
"""Without the condition of the template."""
SCORE = 6


def session(
    text: str, who: str, slot: int = 0, *, threshold: float = 40.0, session: int = 1
) -> list[StoredEvent]:
    """A session of a study file: in its tracks, answers of somebody of that threshold."""
    study = parsed_study(text)
    rng = np.random.default_rng([slot, round(1e6 * threshold)])
    of_touches = np.random.default_rng(slot)
    trials = [planned_trial(trial) for trial in plan(study, slot, session).trials]
    start = opened(who, study.conditions, trials, slot=slot, session=session)
    told: list[Event] = [
        replace(start, study_text=text),
        DeviceArmed.from_json({"idn": "test"}),
        ResonanceMeasured(frequency_hz=24_000.0, tip_m_per_v=9e-9),
    ]
    given: dict[str, list[Answer]] = defaultdict(list)
    for trial in trials:
        if (event := _answer(study, trial, given, threshold, rng)) is not None:
            told.append(TrialStarted(index=trial.index, kind=trial.kind))
            for number, touch in enumerate(trial.touches):
                told += touched(number, touch, study, of_touches, measured=False)
            told.append(event)
    return chain([*told, DeviceOff(confirmed=True, why="over"), SessionCompleted()])


def _answer(
    study: Study,
    trial: PlannedTrial,
    given: dict[str, list[Answer]],
    threshold: float,
    rng: np.random.Generator,
) -> Event | None:
    if trial.track is None:
        return answer(trial, SCORE, change=trial.expected)
    track, role = study.track_of(trial.track.name), trial.track.role
    before = given[track.name]
    order = constant_order(track, study.study.seed, 1, 0) if track.method == "constant" else ()
    level = next_level(track, before, order) if role == "level" else None
    if role == "level" and level is None:
        return None
    level = len(track.values) - 1 if role == "easy" else level
    right = bool(rng.random() < _share(track, level, threshold))
    if role == "level" and level is not None:
        before.append(Answer(level, right))
    choices = ("yes", "no") if track.intervals == 1 else ("first", "second", "third")
    others = [each for each in choices[: max(track.intervals, 2)] if each != trial.expected]
    said = "yes" if right else "no"
    if track.intervals > 1:
        said = trial.expected if right and trial.expected else others[0]
    known = trial.expected is not None
    return replace(
        answer(trial, None, change=said),
        agrees=said == trial.expected if known else None,
        track=TrackAnswer(
            **vars(trial.track),
            level=level,
            value=None if level is None else track.values[level],
            correct=right if known else None,
        ),
    )


def _share(track: Track, level: int | None, threshold: float) -> float:
    if level is None:
        return 0.05 if track.intervals == 1 else 1.0  # always the same interval
    chance = GUESS_RATE[track.task]
    at = (track.share - chance) / (1 - chance)
    felt = 1 - (1 - at) ** ((track.distances[level] / threshold) ** 2)
    return float(chance + (0.99 - chance) * felt)
