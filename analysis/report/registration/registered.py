"""The section on the registration: its results, the deviations, and the calibrations in force."""

from collections.abc import Iterator
from importlib.metadata import version

import numpy as np

from analysis.estimates import Json, plain
from analysis.loading.sessions import is_scored
from analysis.loading.study_lock import StudyLock
from analysis.report.blocks import Block, Items, Section, Table, columns
from analysis.report.findings import Findings
from analysis.report.registration.analysis_settings import analysis_settings
from analysis.report.registration.named_results import NamedResult, named_results
from analysis.report.wording import number
from analysis.trials.contrasts import trial_contrasts
from device.friction.contrasts import LAW, RUNG
from protocol.journal.shared_form import UNKNOWN_UTC
from protocol.registration.deviations import PAPER, Conduct, Deviation, deviations


def section(found: Findings) -> Section:
    """Return what was registered and how it came out; nothing for a study without registration."""
    lock = found.loaded.lock
    if lock is None:
        return Section(name="registration", title="Registration", blocks=[])
    results, departed = (
        named_results(found, lock),
        deviations(lock.registration, conduct(found, lock)),
    )
    later = _later_contrasts(found)
    return Section(
        name="registration",
        title="Registration",
        blocks=[
            f"Plan and analysis were registered{_when(lock)} with touchbeam "
            f"{lock.registration.touchbeam}, before the first session. The digest of the "
            f"registration, SHA-256 {lock.registration.digest}, seeded every order; touchbeam "
            "verify draws them again. Not registered: every result that this table does not name.",
            _results_table(results),
            _deviations(departed),
            _calibrations(lock),
            _later_table(later, found.origin.later.origin if found.origin.later else ""),
        ],
        data={"registration": _record(lock, results, departed, later)},
    )


def _when(lock: StudyLock) -> str:
    """Return the time of the registration, which a data set does not tell."""
    return f" at {lock.utc:%Y-%m-%d %H:%M} UTC" if lock.utc > UNKNOWN_UTC else ""


def registered_lines(found: Findings) -> Iterator[str]:
    """Yield for the terminal what was registered, how it came out, and the deviations."""
    lock = found.loaded.lock
    if lock is not None:
        for result in named_results(found, lock):
            yield f"Registered: {result.name}: {result.verdict} ({result.found})"
        for kind, text in deviations(lock.registration, conduct(found, lock)):
            yield f"Deviation: {kind}: {text}"


def conduct(found: Findings, lock: StudyLock) -> Conduct:
    """Return how the study was conducted and is reported here."""
    origin = found.origin
    by_hand = [
        f"{', '.join(_place(out.participant, out.session, out.trial))}: {out.why}"
        for out in found.loaded.left_out
        if out.by != "rule"
    ]
    return Conduct(
        sessions=lock.sessions,
        amendments=lock.amendments,
        participants=lock.completed,
        by_hand=by_hand,
        withdrawn=found.loaded.sessions_withdrawn,
        withdrawn_completed=found.loaded.withdrawn_completed,
        study_sha256=origin.study_sha256,
        law=LAW,
        rung=RUNG,
        analysis=analysis_settings(found.rating.minimum),
        touchbeam=version("touchbeam"),
        later=origin.later.origin if origin.later else "",
        broken_file=origin.unlocked,
    )


def _place(participant: str, session: int | None, trial: int | None) -> Iterator[str]:
    yield participant
    if session is not None:
        yield f"session {session}"
    if trial is not None:
        yield f"trial {trial}"


def _results_table(results: list[NamedResult]) -> Table:
    return Table(
        name="registered",
        caption="Registered hypotheses. Secondary ones count only if the primary one is supported.",
        columns=columns("hypothesis", "rank", "result", "verdict", kind="text"),
        rows=[
            [each.name, "primary" if each.primary else "secondary", each.found, each.verdict]
            for each in results
        ],
    )


def _deviations(departed: list[Deviation]) -> Block:
    if not departed:
        return "The study did not deviate from its registration."
    return Items(
        name="deviations",
        heading="Deviations from the registration",
        lines=[f"{kind}: {text}" for kind, text in departed],
    )


def _calibrations(lock: StudyLock) -> Block:
    """Return under which calibration each session predicts, if any rig was calibrated."""
    if not any(run.calibration for run in lock.sessions):
        return None
    by_rig: dict[str, list[str]] = {}
    for run in lock.sessions:
        by_rig.setdefault(run.calibration or PAPER, []).append(run.name)
    return Table(
        name="calibrations",
        caption="The calibration in force at each session, under which its trials are predicted.",
        columns=columns("calibration", "sessions", kind="text"),
        rows=[[rig, ", ".join(names)] for rig, names in by_rig.items()],
    )


_Later = dict[str, tuple[float, float]]
"""Mean predicted contrast by condition: as registered, and under a later calibration."""


def _later_contrasts(found: Findings) -> _Later:
    if found.origin.later is None:
        return {}
    loaded = found.loaded
    trials = loaded.trials.assign(rig=None)
    anew = trial_contrasts(found.study, trials, loaded.touches, found.origin.later).by_law[LAW]
    before = found.trials.contrasts.by_law[LAW]
    scored, names = is_scored(trials).to_numpy(), trials["condition"].to_numpy()
    chosen = {name: scored & (names == name) for name in loaded.table.conditions}
    return {
        name: (float(np.mean(before[rows])), float(np.mean(anew[rows])))
        for name, rows in chosen.items()
        if rows.any()
    }


def _later_table(later: _Later, origin: str) -> Table | None:
    if not later:
        return None
    return Table(
        name="later-calibration",
        caption="Mean predicted contrast under the calibration in force, and, not registered, "
        f"under a later one ({origin}); law {LAW}.",
        columns=columns("condition", kind="text")
        + columns("in force (registered)", "later (not registered)"),
        rows=[[name, number(before), number(anew)] for name, (before, anew) in later.items()],
    )


def _record(
    lock: StudyLock, results: list[NamedResult], departed: list[Deviation], later: _Later
) -> Json:
    """Return the registration for programs."""
    settled = lock.registration
    return {
        "digest": settled.digest,
        "utc": lock.utc.isoformat() if lock.utc > UNKNOWN_UTC else None,
        "primary": settled.primary,
        "secondary": list(settled.secondary),
        "results": [plain(each) for each in results],
        "deviations": [each._asdict() for each in departed],
        "law": settled.law,
        "rung": settled.rung,
        "participants": {"registered": settled.participants, "completed": lock.completed},
        "calibrations": {run.name: run.calibration or PAPER for run in lock.sessions},
        "later_calibration": {
            name: {"in_force": plain(before), "later": plain(anew)}
            for name, (before, anew) in later.items()
        },
    }
