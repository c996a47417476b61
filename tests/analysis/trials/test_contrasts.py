"""What the model predicts for single trials: as planned, as measured, under the study in force."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.loading.study_data import load_study_data
from analysis.trials.contrasts import TrialContrasts, stepped, trial_contrasts
from device.friction.changes import CONDITIONS, predicted_contrast
from protocol.journal.events import Event, SessionOpened, SessionResumed, TouchEnded
from protocol.journal.records import Compliance
from protocol.study_file.loading import parsed_study, template
from tests.analysis.chains import chain
from tests.analysis.reports import PAPER, imported, session_events

FORCES_N = (0.5, 0.75)


def paper_session(**changes: Any) -> list[Event]:
    return session_events(PAPER, 0, np.random.default_rng(3), **changes)


def contrasts(events: list[Event]) -> TrialContrasts:
    found = load_study_data([chain(events)], rehearsals=False)
    return trial_contrasts(PAPER, found.trials, found.touches)


def signal(events: list[Event]) -> float:
    """The contrast of the session's second trial."""
    return float(contrasts(events).by_law["consistent"][1])


def under(text: str, events: list[Event]) -> list[Event]:
    """The session as if it was opened under the study `text`."""
    opened = events[0]
    assert isinstance(opened, SessionOpened)
    return [replace(opened, study_text=text), *events[1:]]


def test_what_was_planned_is_predicted_where_nothing_was_measured() -> None:
    found = load_study_data([chain(paper_session(measured=False))], rehearsals=False)
    predicted = trial_contrasts(PAPER, found.trials, found.touches)
    assert not predicted.measured.any()
    scored = found.trials["condition"].notna()
    standard = [
        predicted_contrast(CONDITIONS[name], "coulomb") for name in found.scored["condition"]
    ]
    assert predicted.by_law["coulomb"][scored] == pytest.approx(standard, rel=0.02)


def test_measured_force_is_taken_in_place_of_the_planned_one() -> None:
    light, heavy = (
        signal(
            [
                replace(event, judged=Compliance(force_n=force_n, force_ok=None, place_ok=None))
                if isinstance(event, TouchEnded)
                else event
                for event in paper_session(measured=False)
            ]
        )
        for force_n in FORCES_N
    )
    assert heavy > light, "the inertial load counts less under a heavier finger"


def test_a_trial_is_predicted_under_the_study_that_was_in_force() -> None:
    text = template("paper")
    heavy = text.replace("force_n = 0.5", "force_n = 2.0")
    assert parsed_study(heavy).touch.force_n == 2.0
    plain = paper_session(measured=False)
    resumed = [*plain[:3], SessionResumed.from_json({"study_text": heavy}), *plain[3:]]
    found = [
        signal(events)
        for events in (plain, under(text, plain), under(heavy, plain), under(text, resumed))
    ]
    assert found[0] == found[1] != found[2] == found[3]


def test_a_study_that_cannot_be_read_any_more_gives_way_to_the_present_one() -> None:
    plain = paper_session(measured=False)
    assert signal(under("[study]\nfuture = 1", plain)) == signal(plain)


def test_measured_values_count_in_steps_from_the_planned_one() -> None:
    assert stepped(0.5028, 0.5, 0.025) == 0.5
    assert stepped(0.6, 0.5, 0.025) == 0.6
    assert stepped(0.0421, 0.0414, 0.0005) == 0.0419


def test_a_published_condition_without_a_scene_has_no_prediction() -> None:
    data = imported([[5, 6]], names=("voltage", "temperature"))
    found: FloatArray = trial_contrasts(PAPER, data.trials, data.touches).by_law["consistent"]
    assert found[0] == predicted_contrast(CONDITIONS["voltage"])
    assert np.isnan(found[1])
