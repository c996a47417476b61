"""A session's fixed settings, the events that record them, and its running context."""

import platform
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Literal

from protocol.address import SIMULATED
from protocol.journal.events import SLIDE, SessionOpened, SessionResumed
from protocol.journal.records import RigCalibration, VirtualTruth
from protocol.journal.state import SessionState
from protocol.plan.retries import running_order
from protocol.plan.trials import Plan, Trial, planned_trial
from protocol.study.study import Study
from protocol.study_file.loading import text_digest
from runner.clock import Clock
from runner.interfaces import Device, Operator, Participant
from runner.journal.session_log import SessionLog
from runner.screens import PlanUnit

SessionKind = Literal["participant", "rehearsal", "slide"]
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
    virtual: VirtualTruth | None = None
    registration: str | None = None
    """Digest of the study's registration, which seeds the plan."""
    calibration: RigCalibration | None = None
    """The rig as a sliding experiment determined it, None for the paper's values."""

    @property
    def slides(self) -> bool:
        """Whether it is a sliding experiment, rehearsed or not."""
        return self.participant == SLIDE

    @property
    def unit(self) -> PlanUnit:
        """What its plan consists of."""
        return "pass" if self.slides else "trial"

    def resumption(self) -> SessionResumed:
        """Return the event that records the session when it is resumed."""
        return SessionResumed(
            study_sha256=text_digest(self.study_text),
            study_text=self.study_text,
            trials=tuple(map(planned_trial, self.plan.trials)),
            language=self.language,
            consent=self.consent,
            seed=self.seed,
            virtual=self.virtual,
            versions=versions(),
            registration=self.registration,
            calibration=self.calibration,
        )

    def opening(self) -> SessionOpened:
        """Return the event that records the session when it is opened."""
        return SessionOpened(
            participant=self.participant,
            session=self.number,
            kind=self.kind,
            study=self.study.study.name,
            slot=None if self.slides else self.plan.slot,
            sequence=self.plan.sequence,
            conditions=self.study.conditions,
            answer_order=self.answer_order,
            **vars(self.resumption()),
        )


def answer_order(study: Study, slot: int, before: SessionState | None) -> AnswerOrder:
    """Return the order of answers for the participant of `slot`.

    A session that was begun keeps its order; `before` is its state, None if it is new.
    """
    if before is not None and isinstance(before.opened, SessionOpened):
        return "reversed" if before.opened.answer_order == "reversed" else "forward"
    turned = study.session.answer_order == "counterbalanced" and slot % 2 == 1
    return "reversed" if turned else "forward"


def versions() -> dict[str, str]:
    """Return the versions of touchbeam and Python."""
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

    `address` is where the device was reached, `sim` for one that is simulated.
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
    identity: str = field(default="", init=False)
    resonance_hz: float = field(default=0.0, init=False)
    pause_wanted: bool = field(default=False, init=False)
    beam_in_doubt: bool = field(default=False, init=False)
    zero: Zero | None = field(default=None, init=False)

    @property
    def order(self) -> list[Trial]:
        """All trials in the order in which they are run; those that come again have moved."""
        return running_order(self.session.plan.trials, self.log.state.deferred)

    @property
    def pending(self) -> list[Trial]:
        """The trials without an answer, in order."""
        return [trial for trial in self.order if trial.index not in self.log.state.answered]
