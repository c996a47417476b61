"""What a session is: who, which plan, on which rig; and how that is written down."""

import platform
from dataclasses import asdict, dataclass
from hashlib import sha256
from importlib.metadata import version
from typing import Any, Literal

from protocol.plan import Plan, Trial
from protocol.study import Study
from protocol.texts import Language

Kind = Literal["participant", "rehearsal"]


@dataclass(frozen=True, kw_only=True)
class Session:
    """One participant's session, decided before it begins."""

    participant: str
    number: int
    kind: Kind
    study: Study
    study_text: str
    plan: Plan
    language: Language = "en"
    consent: str | None = None
    seed: int = 1

    def resumption(self) -> dict[str, Any]:
        """Return what the journal says of the session when it is taken up again."""
        return {
            "study_sha256": text_digest(self.study_text),
            "study_text": self.study_text,
            "trials": [trial_record(trial) for trial in self.plan.trials],
            "language": self.language,
            "consent": self.consent,
            "seed": self.seed,
            "versions": versions(),
        }

    def opening(self) -> dict[str, Any]:
        """Return what the journal says of the session when it opens."""
        return {
            "participant": self.participant,
            "session": self.number,
            "kind": self.kind,
            "study": self.study.study.name,
            "slot": self.plan.slot,
            "sequence": list(self.plan.sequence),
            "conditions": list(self.study.conditions),
            **self.resumption(),
        }


def versions() -> dict[str, str]:
    """Return what ran: touchbeam and Python."""
    return {"touchbeam": version("touchbeam"), "python": platform.python_version()}


def text_digest(text: str) -> str:
    """Return the digest that identifies a study file."""
    return sha256(text.encode()).hexdigest()


def trial_record(trial: Trial) -> dict[str, Any]:
    """Return `trial` as JSON can hold it."""
    touches = [touch.model_dump(exclude_none=True) for touch in trial.touches]
    return {**asdict(trial), "touches": touches}
