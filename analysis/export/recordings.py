"""What was recorded during touches, as tables: forces and place, and the drive beside them."""

import gzip
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.friction.recorded import decoded
from protocol.journal.events import (
    Opening,
    StoredEvent,
    TouchEnded,
    TouchRecorded,
    TrialStarted,
    Withdrawn,
)
from protocol.journal.records import CHANNELS, DamagedSamplesError, ReadBack
from protocol.study.columns import Column, names_of

SessionKey = tuple[str, int, str]
"""Participant, number and kind of a session."""

MEASURED = (
    Column("tangential_n", "Force along the surface that resists the sliding finger.", "N"),
    Column("normal_n", "Force of the finger onto the surface.", "N"),
    Column("position_m", "Place of the finger's right edge along the surface.", "m"),
)
DRIVEN = (
    Column(
        "voltage_v",
        "Amplitude (peak) as read back, in between interpolated; missing before the first and "
        "after the last reading.",
        "V",
    ),
    Column("frequency_hz", "Frequency of the drive, likewise.", "Hz"),
    Column("mark_moves", "Whether the mark moved that the finger was to follow, or to wait for."),
)
TIME = Column("t_s", "Time on the clock of started_monotonic_s in the trials.", "s")
_FORMS = {"position_m": "%.7g", "frequency_hz": "%.8g", "mark_moves": "%d"}
_NUMBER = "%.6g"


@dataclass(frozen=True, kw_only=True)
class RecordedTouch:
    """A touch of a trial's last attempt, its samples, and the drive as it was read back."""

    trial_index: int
    recording: TouchRecorded
    read_back: tuple[ReadBack, ...]

    @property
    def touch(self) -> int:
        """Its number in its trial, from 0."""
        return self.recording.touch

    @property
    def start_s(self) -> float:
        """When the first sample was taken, on the session's clock."""
        return self.recording.first_s + self.recording.clock_offset_s

    def measured(self) -> NDArray[np.float64]:
        """Return a row per sample: the forces, less those of the untouched beam, and the place."""
        return decoded(self.recording, self.recording.tare_n)[2].T

    def times_s(self) -> NDArray[np.float64]:
        """Return when each sample was taken, on the session's clock."""
        return self.start_s + np.arange(self.recording.count) / self.recording.rate_hz

    def driven(self) -> NDArray[np.float64]:
        """Return a row per sample: amplitude and frequency, and whether the mark moved."""
        times_s, recorded = self.times_s(), self.recording
        # A reading without the device's time cannot be placed among the samples.
        known = [entry for entry in self.read_back if entry.device_time_s is not None]
        read_s = np.array([entry.device_time_s for entry in known]) + recorded.clock_offset_s
        columns = [np.full(len(times_s), np.nan)] * 2
        # A gauge has a clock of its own, to which the times of the drive say nothing.
        if known and recorded.source == "board":
            drives = zip(*((entry.voltage_v, entry.frequency_hz) for entry in known), strict=True)
            columns = [np.interp(times_s, read_s, drive, np.nan, np.nan) for drive in drives]
        begin_s, end_s = recorded.moved_s
        return np.column_stack([*columns, (times_s >= begin_s) & (times_s < end_s)])


def recorded_touches(events: Sequence[StoredEvent]) -> tuple[RecordedTouch, ...]:
    """Return what a session recorded, of each trial its last attempt.

    Nothing of a session that was withdrawn, and no samples that are not those recorded.
    """
    tags = {event.tag for event in events}
    # By their tags, because an event is parsed when its record is asked for, which takes long.
    if TouchRecorded.TAG not in tags or Withdrawn.TAG in tags or any(it.erased for it in events):
        return ()
    by_trial: dict[int, list[RecordedTouch]] = {}
    trial = 0
    recorded: TouchRecorded | None = None
    for event in events:
        if event.tag not in {TrialStarted.TAG, TouchRecorded.TAG, TouchEnded.TAG}:
            continue
        match event.record:
            # A trial that comes again replaces what its earlier attempt recorded.
            case TrialStarted(index=trial):
                by_trial[trial] = []
            case TouchRecorded() as told:
                recorded = told
            case TouchEnded(touch=number, read_back=read_back):
                if recorded is not None and recorded.touch == number and _whole(recorded):
                    by_trial.setdefault(trial, []).append(
                        RecordedTouch(trial_index=trial, recording=recorded, read_back=read_back)
                    )
                recorded = None
    return tuple(touch for _, touches in sorted(by_trial.items()) for touch in touches)


def _whole(recorded: TouchRecorded) -> bool:
    try:
        recorded.counts()
    except DamagedSamplesError:
        return False
    return True


def session_key(events: Sequence[StoredEvent]) -> SessionKey | None:
    """Return which session `events` are of; None for other chains and erased ones."""
    opening = events[0].record if events and not events[0].erased else None
    if not isinstance(opening, Opening):
        return None
    return opening.participant, opening.session, opening.kind


def described(touch: RecordedTouch, columns: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return what a sidecar says of this touch and of its `columns`, described by name."""
    tare_n, clock_s = touch.recording.tare_n, touch.recording.clock_error_s
    zero = "as the sensor gave it: it was not measured on the untouched beam before"
    told = dict(columns)
    for number, name in enumerate(CHANNELS[:2]):
        if name in told:
            if tare_n is not None:
                zero = f"less {tare_n[number]:.4g} N, measured on the untouched beam before"
            description = f"{told[name]['Description']} It is {zero}."
            told[name] = {**told[name], "Description": description}
    return {
        "SamplingFrequency": touch.recording.rate_hz,
        # Microseconds, as `t_s` in the other formats.
        "StartTime": round(touch.start_s, 6),
        "Columns": list(columns),
        "Description": f"Trial {touch.trial_index}, touch {touch.touch} (both from 0). StartTime "
        f"is on the clock of started_monotonic_s in the trials, within {1e3 * clock_s:.2g} ms.",
        **told,
    }


def tsv_gz(columns: Sequence[str], rows: NDArray[np.float64]) -> bytes:
    """Return the rows as BIDS has them: tab-separated, without a header, compressed."""
    # Without the time of day in its header the same samples give the same bytes.
    return gzip.compress(_lines(columns, rows, "\t", b"n/a"), mtime=0)


def samples_csv(touches: Sequence[RecordedTouch]) -> bytes:
    """Return the samples of all touches as one table."""
    names = names_of((*MEASURED, *DRIVEN))
    header = ",".join(["trial_index", "touch", "t_s", *names])
    return b"".join([f"{header}\n".encode(), *_csv_parts(touches, names)])


def _csv_parts(touches: Sequence[RecordedTouch], names: Sequence[str]) -> Iterator[bytes]:
    for touch in touches:
        rows = np.column_stack([touch.times_s(), touch.measured(), touch.driven()])
        before = f"{touch.trial_index},{touch.touch},".encode()
        lines = _lines(["t_s", *names], rows, ",", b"").splitlines(keepends=True)
        yield b"".join(before + line for line in lines)


def _lines(
    columns: Sequence[str], rows: NDArray[np.float64], between: str, missing: bytes
) -> bytes:
    out = io.BytesIO()
    forms = ["%.6f" if name == "t_s" else _FORMS.get(name, _NUMBER) for name in columns]
    np.savetxt(out, rows, fmt=forms, delimiter=between, newline="\n")
    return out.getvalue().replace(b"nan", missing)
