"""The lock of a study, from its journal: the registration, what broke it, who ran under it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import pandas as pd

from analysis.loading.records import values
from device.friction.calibration import NOMINAL, Calibration
from device.friction.surfaces import PAPERS
from protocol.journal import events as journal
from protocol.registration.deviations import Amendment, SessionRun
from protocol.registration.registration import Registration, registration_in

Decisions = Sequence[tuple[datetime, journal.Event]]
"""Decisions on the study as a whole, each with its UTC, in their order."""


@dataclass(frozen=True, kw_only=True)
class StudyLock:
    """A registration, what happened to it, and the sessions that are reported.

    `completed` counts the participants with as many completed sessions as were registered, and
    `groups` those of each group.
    """

    registration: Registration
    utc: datetime
    amendments: tuple[Amendment, ...]
    sessions: tuple[SessionRun, ...]
    completed: int
    groups: Mapping[str, int] = field(default_factory=dict)

    @property
    def rig(self) -> Calibration:
        """The calibration that was registered."""
        values = self.registration.calibration
        numbers = {name: float(value) for name, value in values.items() if name != "origin"}
        return (
            Calibration.of(PAPERS, **numbers, origin=str(values["origin"])) if values else NOMINAL
        )


def default_rig(lock: StudyLock | None, kinds: Sequence[str], fitted: Calibration) -> Calibration:
    """Return the rig of trials for which the journal holds no calibration.

    It is the registered one, else `fitted`, the study's at present. Published scores alone were
    felt on a rig of their own, which no calibration describes.
    """
    if lock is not None:
        return lock.rig.on(fitted.surface)
    return NOMINAL if tuple(kinds) == ("published",) else fitted


def study_lock(decisions: Decisions, sessions: pd.DataFrame) -> StudyLock | None:
    """Return the lock of a study, None if it is not registered.

    `sessions` are those that are reported.

    Raises:
        BadInput: the registration in the journal was changed.
    """
    registered = [
        (utc, event) for utc, event in decisions if isinstance(event, journal.StudyRegistered)
    ]
    if not registered:
        return None
    utc, event = registered[-1]
    found = registration_in(event.text, "the registration in the journal")
    counted = Counter(sessions["participant"][sessions["session_completed"]])
    completed = [name for name, number in counted.items() if number >= found.sessions]
    groups = sessions.groupby("participant")["group"].first()
    return StudyLock(
        registration=found,
        utc=utc,
        amendments=tuple(
            Amendment(utc=when, reason=change.reason)
            for when, change in decisions
            # An amendment that broke an earlier registration is no deviation from this one.
            if isinstance(change, journal.StudyAmended) and change.breaks == found.digest
        ),
        sessions=tuple(map(_run, sessions.to_dict("records"))),
        completed=len(completed),
        groups=Counter(values(groups[completed].dropna())),
    )


def _run(session: Mapping[Any, Any]) -> SessionRun:
    rig, digest, study = (session[key] for key in ("calibration", "registration", "study_sha256"))
    return SessionRun(
        name=f"{session['participant']}/{session['session']}",
        number=session["session"],
        registration=digest if isinstance(digest, str) else None,  # NaN where it is missing
        study_sha256=study if isinstance(study, str) else None,
        touchbeam=session["versions"].get("touchbeam", ""),
        calibration=rig.origin if isinstance(rig, Calibration) else "",
    )


def rig_in_force(event: journal.SessionTerms) -> Calibration | None:
    """Return the rig under which a registered session predicts, None for any other session."""
    if event.registration is None:
        return None
    return NOMINAL if event.calibration is None else Calibration(**vars(event.calibration))
