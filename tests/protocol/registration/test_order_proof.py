"""Orders are proved from the journal alone: a plan made under another seed fails."""

from dataclasses import replace

import pytest

from protocol.journal.events import SLIDE, SessionOpened, event_of
from protocol.plan.plan import plan, slide_plan, slide_study
from protocol.plan.trials import planned_trial
from protocol.registration.registration import locked, order_problem
from protocol.study_file.loading import parsed_study, template, text_digest

TEXT = template("extended")
STUDY = parsed_study(TEXT)
DIGEST = "5a" * 32


def opened(seeded_by: str | None = DIGEST, *, slot: int = 3, session: int = 1) -> SessionOpened:
    study = STUDY if seeded_by is None else locked(STUDY, seeded_by)
    event = SessionOpened.from_json(
        {
            "participant": "P04",
            "session": session,
            "kind": "participant",
            "slot": slot,
            "conditions": list(STUDY.conditions),
            "study_sha256": text_digest(TEXT),
            "study_text": TEXT,
            "trials": [
                planned_trial(trial).to_json() for trial in plan(study, slot, session).trials
            ],
            "registration": DIGEST,
        }
    )
    stored = event_of(event.TAG, event.to_json())
    assert isinstance(stored, SessionOpened)
    return stored


@pytest.mark.parametrize(("slot", "session"), [(0, 1), (3, 1), (12, 2)])
def test_the_orders_of_a_digest_are_proved(slot: int, session: int) -> None:
    event = opened(slot=slot, session=session)
    assert order_problem(event, event) == ""


@pytest.mark.parametrize("seed", [None, "5b" * 32])
def test_a_plan_of_another_seed_fails(seed: str | None) -> None:
    event = opened(seed)
    assert "its order does not follow from the registration: trial" in order_problem(event, event)


def test_a_single_changed_trial_fails() -> None:
    event = opened()
    changed = replace(event.trials[-1], level=0.123)
    event = replace(event, trials=(*event.trials[:-1], changed))
    assert f"trial {changed.index} is" in order_problem(event, event)
    lost = replace(event, trials=event.trials[:-1])
    assert f"the journal has {len(lost.trials)}" in order_problem(lost, lost)


def test_a_changed_touch_fails() -> None:
    event = opened()
    *others, last = event.trials
    (first, *rest) = last.touches
    changed = replace(last, touches=({**first, "voltage_v": 1.0}, *rest))
    event = replace(event, trials=(*others, changed))
    assert f"trial {last.index} is" in order_problem(event, event)


def test_a_study_file_without_its_digest_fails() -> None:
    event = replace(opened(), study_sha256="0" * 64)
    assert "does not have the digest" in order_problem(event, event)
    event = replace(opened(), study_text="[study]", study_sha256=text_digest("[study]"))
    assert "its order cannot be drawn again" in order_problem(event, event)


def test_an_unregistered_session_is_not_judged() -> None:
    event = replace(opened(None), registration=None)
    assert order_problem(event, event) == ""


def test_a_sliding_experiment_is_proved_too() -> None:
    def drawn(digest: str) -> SessionOpened:
        trials = slide_plan(slide_study(locked(STUDY, digest)), 1).trials
        made = tuple(map(planned_trial, trials))
        return replace(opened(), participant=SLIDE, slot=None, trials=made)

    assert order_problem(drawn(DIGEST), drawn(DIGEST)) == ""
    assert "does not follow" in order_problem(drawn("5b" * 32), drawn("5b" * 32))
