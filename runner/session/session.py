"""A session's fixed settings, the events that record them, and its running context."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Literal, TypeVar

from protocol.address import SIMULATED
from protocol.journal import records
from protocol.journal.events import SLIDE, SessionOpened, SessionResumed
from protocol.journal.state import SessionState
from protocol.plan.plan import running_order
from protocol.plan.trials import Plan, Trial, planned_trial
from protocol.study.study import Study
from protocol.study.study_question import Answer
from protocol.study_file.loading import text_digest
from runner.clock import Clock
from runner.journal.store import SessionLog
from runner.screens import (
    Device,
    Operator,
    Participant,
    PlanUnit,
    ShownSurface,
    WindowState,
    shown_surface,
)

SessionKind = Literal["participant", "rehearsal", "slide"]
_Kind = TypeVar("_Kind", SessionOpened, SessionResumed)
AnswerOrder = Literal["forward", "reversed"]
"""Of the answers to a choice: as in the study file, or from last to first."""


@dataclass(frozen=True, kw_only=True)
class Session:
    """One participant's session, or a sliding experiment, fixed before it starts."""

    participant: str
    number: int
    kind: SessionKind
    study: Study
    study_text: str
    plan: Plan
    language: str = "en"
    answer_order: AnswerOrder = "forward"
    consent: str | None = None
    seed: int = 1
    virtual: records.VirtualTruth | None = None
    group: str | None = None
    noted: Mapping[str, str] = field(default_factory=dict)
    """What the operator answered before it was opened, because the group follows from it."""
    override: str | None = None
    """Why it began before or after it was due."""
    told: Mapping[str, Answer] = field(default_factory=dict)
    """Answers to what is asked in the first session alone, in a later one."""
    volts: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Voltages of the levels of tracks on the axis of contrast, by track."""
    registration: str | None = None
    """Digest of the study's registration, which seeds the plan."""
    calibration: records.RigCalibration | None = None
    """The rig as a sliding experiment determined it, None for the paper's values."""

    @property
    def slides(self) -> bool:
        """Whether it is a sliding experiment, rehearsed or not."""
        return self.participant == SLIDE

    @property
    def unit(self) -> PlanUnit:
        """What its plan consists of."""
        return "pass" if self.slides else "trial"

    def recorded_as(self, kind: type[_Kind]) -> _Kind:
        """Return the event that records that the session is opened, or resumed."""
        # Both record the same, since all of it may change in between.
        known = {
            **vars(self),
            "session": self.number,
            "study": self.study.study.name,
            "slot": None if self.slides else self.plan.slot,
            "sequence": self.plan.sequence,
            "conditions": self.study.conditions,
            "study_sha256": text_digest(self.study_text),
            "trials": tuple(map(planned_trial, self.plan.trials)),
            "versions": versions(),
        }
        return kind(**{each.name: known[each.name] for each in fields(kind)})


def known_before(
    session: Session, state: SessionState, block: int | None = None
) -> dict[str, Answer]:
    """Return the answers on which a question may depend that is asked after `block`, by name.

    Those after this block alone, and those that are given once; without a block the latter alone.
    """
    given = state.questions.items()
    return {**session.told, **{name: answer for (name, of), answer in given if of in {None, block}}}


def answer_order(study: Study, slot: int, before: SessionState | None) -> AnswerOrder:
    """Return the order of answers for the participant of `slot`.

    A session that was begun keeps its order; `before` is its state, None if it is new.
    """
    # Else an amended study could turn the answers in the middle of a session.
    if before is not None and isinstance(before.opened, SessionOpened):
        return "reversed" if before.opened.answer_order == "reversed" else "forward"
    # By slot, so that both orders are equally frequent among those who finish.
    turned = study.session.answer_order == "counterbalanced" and slot % 2 == 1
    return "reversed" if turned else "forward"


def versions() -> dict[str, str]:
    return {"touchbeam": version("touchbeam"), "python": platform.python_version()}


@dataclass(frozen=True, kw_only=True)
class Zero:
    """Tangential and normal force of the untouched beam, measured at `at_s`.

    `doubted_n` are those found since, when something seemed to touch it.
    """

    forces_n: tuple[float, float]
    at_s: float
    doubted_n: tuple[float, float] | None = None

    @property
    def trusted(self) -> bool:
        """Whether it is the zero of the next touch."""
        return self.doubted_n is None


@dataclass(kw_only=True)
class SessionContext:
    """A running session with its device, people, clock and log.

    `address` is where the device was reached, `sim` for one that is simulated. `study_folder` has
    the picture of the surface, if participants see one.
    `identity` is the device's answer to `*IDN?` once it is armed.
    `opened_now` is True for a new session and False for a resumed one. `resonance_hz` is 0 until
    it has been measured. `beam_in_doubt` is True while the operator has been asked to mount a beam
    and has not confirmed it. `zero` is the last tare of the force channel on the mounted beam, None
    before the first.
    """

    session: Session
    device: Device
    participant: Participant
    operator: Operator
    clock: Clock
    log: SessionLog
    opened_now: bool
    address: str = SIMULATED
    study_folder: Path | None = None
    identity: str = field(default="", init=False)
    resonance_hz: float = field(default=0.0, init=False)
    pause_wanted: bool = field(default=False, init=False)
    beam_in_doubt: bool = field(default=False, init=False)
    zero: Zero | None = field(default=None, init=False)
    window_state: WindowState | None = field(default=None, init=False)
    """As last recorded."""

    @cached_property
    def surface(self) -> ShownSurface:
        return shown_surface(self.session.study, self.study_folder)

    @property
    def order(self) -> list[Trial]:
        """All trials in the order in which they are run; those that come again have moved."""
        # Derived from the journal, so that nothing can disagree with it after an interruption.
        return running_order(self.session.plan.trials, self.log.state.deferred)

    @property
    def pending(self) -> list[Trial]:
        """The trials that are needed and have no answer, in order."""
        over = self.log.state.answered | self.log.state.not_needed
        return [trial for trial in self.order if trial.index not in over]
