"""The passes of a sliding experiment as the journal has them, less what the analysis leaves out."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.sliding.passes import BIN_M, Pass
from protocol.errors import BadInput
from protocol.journal.events import (
    Answered,
    DeviceArmed,
    ResonanceMeasured,
    SessionOpened,
    SessionResumed,
    StoredEvent,
    TouchRecorded,
    TouchStarted,
    TrialStarted,
)
from protocol.journal.records import LIFTED_N, CommandedDrive, DamagedSamplesError, Recording
from protocol.journal.state import folded
from protocol.study.touch import Slide
from protocol.study_file.loading import parsed_study

Zero = tuple[float, float]
_LEAST_M = 6 * BIN_M
_SMOOTH_S = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPass:
    """A pass with what tells it from the others; `drive` is its name in the plan."""

    index: int
    drive: str
    made: Pass


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnSession:
    """A sliding experiment: its passes, and the rig on which they were made.

    Attributes:
        session: what people call it.
        rehearsal: whether it is a rehearsal.
        planned: number of passes of the plan.
        passes: those that count, in the order in which they were made.
        left_out: those that were made and do not count: number and reason.
        resonance: the resonance that was measured last.
        idn: the device's answer to `*IDN?`.
    """

    session: str
    rehearsal: bool
    planned: int
    passes: tuple[PlannedPass, ...]
    left_out: tuple[tuple[int, str], ...]
    resonance: ResonanceMeasured
    idn: str


@dataclass(kw_only=True)
class _Attempt:
    """The pass that is being made."""

    index: int
    commanded: CommandedDrive | None = None
    recorded: Recording | None = None


def drawn_session(events: Sequence[StoredEvent]) -> DrawnSession:
    """Return the sliding experiment whose events these are.

    A pass without a zero of its own has the last one before it.

    Raises:
        BadInput: no pass has been made.
    """
    excluded = folded(events).excluded
    records = [event.record for event in events]
    opened = records[0]
    assert isinstance(opened, SessionOpened), "the first event of every session"
    planned = {trial.index: trial for trial in opened.trials}
    slide = _slide(records)
    found, left_out = [], []
    for attempt, zero in _attempts(records):
        made = _pass(attempt, slide, str(planned[attempt.index].touches[0]["direction"]), zero)
        if why := excluded.get(attempt.index, made if isinstance(made, str) else None):
            left_out.append((attempt.index, why))
        elif isinstance(made, Pass):
            drive = str(planned[attempt.index].condition)
            found.append(PlannedPass(index=attempt.index, drive=drive, made=made))
    resonances = [record for record in records if isinstance(record, ResonanceMeasured)]
    if not found or not resonances:
        raise BadInput(f"slide/{opened.session}: no pass has been made that counts")
    return DrawnSession(
        session=f"{opened.participant}/{opened.session}",
        rehearsal=opened.kind == "rehearsal",
        planned=len(planned),
        passes=tuple(found),
        left_out=tuple(left_out),
        resonance=resonances[-1],
        idn=next((each.idn for each in reversed(records) if isinstance(each, DeviceArmed)), ""),
    )


def _slide(records: Sequence[object]) -> Slide:
    """Return what was drawn, from the study as it was when the session began or last resumed."""
    kinds = SessionOpened | SessionResumed
    text = [each.study_text for each in records if isinstance(each, kinds)][-1]
    assert text is not None, "every build that slides records the study"
    return parsed_study(text).slide


def _attempts(records: Sequence[object]) -> Iterator[tuple[_Attempt, Zero]]:
    """Yield every pass that was made to its end, with its zero or the last one before it."""
    attempt, zero = _Attempt(index=-1), (0.0, 0.0)
    for record in records:
        match record:
            case TrialStarted(index=index):
                attempt = _Attempt(index=index)
            case TouchStarted(commanded=commanded):
                attempt.commanded = commanded
            case TouchRecorded():
                attempt.recorded = record
                if record.tare_n is not None:
                    zero = record.tare_n[0], record.tare_n[1]
            case Answered():
                yield attempt, zero


def _pass(attempt: _Attempt, slide: Slide, direction: str, zero: Zero) -> Pass | str:
    """Return the pass while the mark moved and the block was on the beam, or why there is none."""
    recorded, commanded = attempt.recorded, attempt.commanded
    if recorded is None or commanded is None:
        return "nothing was recorded"
    try:
        counts = np.frombuffer(recorded.counts(), "<i2").reshape(3, recorded.count)
    except DamagedSamplesError as error:
        return str(error)
    tangential_n, normal_n, x_m = counts * np.array(recorded.scale)[:, None]
    tangential_n, normal_n = tangential_n - zero[0], normal_n - zero[1]
    t_s = recorded.first_s + recorded.clock_offset_s + np.arange(x_m.size) / recorded.rate_hz
    began_s, over_s = recorded.moved_s
    chosen = (t_s >= began_s) & (t_s <= over_s) & (normal_n > LIFTED_N)
    if chosen.sum() < recorded.rate_hz * (over_s - began_s) / 2:
        return "the block was not on the beam"
    if np.ptp(x_m[chosen]) < _LEAST_M:
        return "the block did not move"
    way_m = _smooth(x_m[chosen] if direction == "right" else -x_m[chosen], recorded.rate_hz)
    if (np.maximum.accumulate(way_m) - way_m).max() > _LEAST_M:
        return "the block went back"
    chosen = np.flatnonzero(chosen)[_moving(way_m)]
    return Pass(
        voltage_v=commanded.voltage_v,
        frequency_hz=commanded.frequency_hz,
        direction="left" if direction == "left" else "right",
        load_n=slide.load_n,
        contact_m=slide.contact_m,
        t_s=t_s[chosen],
        x_m=x_m[chosen],
        mu=tangential_n[chosen] / normal_n[chosen],
    )


def _smooth(way_m: FloatArray, rate_hz: float) -> FloatArray:
    """Return means over `_SMOOTH_S`, so that the sensor's noise is no movement."""
    length = max(round(_SMOOTH_S * rate_hz), 1)
    padded_m = np.pad(way_m, length, mode="edge")
    smooth_m = np.convolve(padded_m, np.ones(length) / length, "same")
    return np.asarray(smooth_m[length:-length])


def _moving(way_m: FloatArray) -> slice:
    """Return the part of a pass in which the block moves: a hand begins late and ends early.

    A block at rest has another friction, and hundreds of samples at one place.
    """
    begun = np.flatnonzero(way_m < way_m.min() + BIN_M)[-1]
    over = np.flatnonzero(way_m > way_m.max() - BIN_M)[0]
    return slice(int(begun), int(over))
