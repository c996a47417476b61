"""Deviations of a study from its registration: all that was done otherwise, one line each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

from protocol.registration.registration import Registration, Setting

PAPER = "the paper's values"


class Deviation(NamedTuple):
    """A departure from the registration; `kind` is what it concerns."""

    kind: str
    text: str


@dataclass(frozen=True, kw_only=True)
class SessionRun:
    """A session as it was run; the origin of its `calibration` is empty for the paper's values."""

    name: str
    number: int
    registration: str | None
    study_sha256: str | None
    touchbeam: str
    calibration: str


@dataclass(frozen=True, kw_only=True)
class Amendment:
    """A change of the study file that was accepted after the registration."""

    utc: datetime
    reason: str


@dataclass(frozen=True, kw_only=True)
class Conduct:
    """How a registered study was conducted and is reported.

    Attributes:
        participants: how many completed all their sessions, and `groups` how many in each.
        by_hand: what was excluded without a rule, and why.
        withdrawn: how many sessions were erased, of which `withdrawn_completed` had been completed.
        study_sha256: digest of the present study file.
        law, rung: under which contrasts are predicted.
        untested: the registered hypotheses whose tests the version that reports does not have.
        later: the origin of a calibration made since the last session, empty without one.
        broken_file: what is wrong with the file of the registration.
    """

    sessions: Sequence[SessionRun]
    amendments: Sequence[Amendment]
    participants: int
    by_hand: Sequence[str]
    study_sha256: str
    law: str
    rung: str
    analysis: Mapping[str, Setting]
    touchbeam: str
    groups: Mapping[str, int] = field(default_factory=dict)
    withdrawn: int = 0
    withdrawn_completed: int = 0
    untested: Sequence[str] = ()
    later: str = ""
    broken_file: str = ""


def deviations(registered: Registration, conduct: Conduct) -> list[Deviation]:
    """Return every deviation from what was registered; an empty list if there is none."""
    return [
        *_of_files(registered, conduct),
        *_of_sessions(registered, conduct.sessions),
        *_of_numbers(registered, conduct),
        *_of_analysis(registered, conduct),
    ]


def _of_files(registered: Registration, conduct: Conduct) -> Iterator[Deviation]:
    if conduct.broken_file:
        yield Deviation("registration", conduct.broken_file)
    for change in conduct.amendments:
        text = f"amended at {change.utc:%Y-%m-%d %H:%M} UTC, which broke the lock: {change.reason}"
        yield Deviation("study file", text)
    # The file may have changed without an amendment, or an amended one back again.
    if conduct.study_sha256 != registered.study_sha256:
        yield Deviation("study file", "the present study file is not the registered one")


def _of_sessions(registered: Registration, sessions: Sequence[SessionRun]) -> Iterator[Deviation]:
    digest, file, version = registered.digest, registered.study_sha256, registered.touchbeam
    rig, many = str(registered.calibration.get("origin", "")), registered.sessions
    named = [
        ("registration", "sessions without it or under another one", "registration", digest),
        ("study file", "sessions under another study file", "study_sha256", file),
        ("version", f"sessions by a touchbeam other than {version}", "touchbeam", version),
    ]
    runs = [
        (kind, text, [run.name for run in sessions if getattr(run, key) != value])
        for kind, text, key, value in named
    ]
    # One line for each calibration, in the order in which they were in force.
    for other in dict.fromkeys(run.calibration for run in sessions if run.calibration != rig):
        text = f"registered: {rig or PAPER}; in force: {other or PAPER}, in sessions"
        runs += [("calibration", text, [run.name for run in sessions if run.calibration == other])]
    text = f"more than the {many} registered for each"
    runs += [("sessions", text, [run.name for run in sessions if run.number > many])]
    for kind, text, names in runs:
        if names:
            yield Deviation(kind, f"{text}: {', '.join(names)}")


def _of_numbers(registered: Registration, conduct: Conduct) -> Iterator[Deviation]:
    # More is a deviation, too: the data collection was then ended by another rule.
    counts = {"": (conduct.participants, registered.participants)}
    counts |= {f"{of}: ": (conduct.groups.get(of, 0), n) for of, n in registered.groups.items()}
    for of, (completed, wanted) in counts.items():
        if completed != wanted:
            less = "fewer" if completed < wanted else "more"
            text = f"{of}{completed} completed, {less} than the {wanted} registered"
            yield Deviation("participants", text)
    for left_out in conduct.by_hand:
        yield Deviation("exclusion", f"without a registered rule: {left_out}")
    if conduct.withdrawn:
        yield Deviation(
            "withdrawal",
            f"sessions withdrawn, whose data are erased: {conduct.withdrawn}, of which "
            f"{conduct.withdrawn_completed} had been completed",
        )


def _of_analysis(registered: Registration, conduct: Conduct) -> Iterator[Deviation]:
    if (conduct.law, conduct.rung) != (registered.law, registered.rung):
        settled = f"{registered.law} on {registered.rung}"
        text = f"law {conduct.law} on rung {conduct.rung}; registered: {settled}"
        yield Deviation("prediction", text)
    if conduct.touchbeam != registered.touchbeam:
        text = f"reported by touchbeam {conduct.touchbeam}, not {registered.touchbeam}"
        yield Deviation("version", text)
    for name in conduct.untested:
        text = f"{name}: not tested, as touchbeam {conduct.touchbeam} does not have its test"
        yield Deviation("hypothesis", text)
    # Settings of either side: one that was added or dropped is a deviation, too.
    for name in sorted({*registered.analysis, *conduct.analysis}):
        before, used = registered.analysis.get(name), conduct.analysis.get(name)
        if before != used:
            yield Deviation("analysis", f"{name}: {used}; registered: {before}")
    if conduct.later:
        yield Deviation(
            "calibration",
            f"{conduct.later} is later than the sessions; what it predicts stands beside the "
            "registered prediction",
        )
