"""From the journal to passes: forces less their zero, while the mark moved; what is left out."""

from array import array
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from analysis.sliding.experiment import DrawnSession, drawn_session
from protocol.errors import BadInput
from protocol.journal.events import (
    SLIDE,
    Answered,
    BeamMounted,
    DeviceArmed,
    DeviceOff,
    Event,
    ResonanceMeasured,
    SessionCompleted,
    SessionOpened,
    StoredEvent,
    TouchEnded,
    TouchRecorded,
    TouchStarted,
    TrialAborted,
    TrialExcluded,
    TrialIncluded,
    TrialStarted,
)
from protocol.journal.records import NOT_JUDGED, CommandedDrive, PlannedTrial
from protocol.plan.plan import slide_plan, slide_study
from protocol.study_file.loading import parsed_study, template

SECTION = "[slide]\nfrequencies = [1.0]\nfrequencies_hz = []\nreferences = 1\nload_n = 0.7\n"
TEXT = template("paper").replace("[touch]", f"{SECTION}\n[touch]", 1)
RATE_HZ = 100
SCALE = (2.5e-4, 2.5e-4, 5e-6)
OFFSET_S = 1000.0
"""The session's clock minus the device's."""
ZERO_N = (0.02, -0.01)


def recorded(
    friction: float = 0.4,
    *,
    load_n: float = 0.7,
    tare_n: tuple[float, float] | None = ZERO_N,
    moves_m: float = 0.071,
    begins_s: float = 1.0,
    lasts_s: float = 2.0,
) -> TouchRecorded:
    """A block that waits for 1 s, then moves for 2 s, and the sensors' zeros."""
    t_s = np.arange(3 * RATE_HZ) / RATE_HZ
    x_m = 0.010 + moves_m * np.clip((t_s - begins_s) / lasts_s, 0, 1)
    normal_n = np.full(t_s.size, load_n)
    channels = [friction * normal_n + ZERO_N[0], normal_n + ZERO_N[1], x_m]
    counts = [np.round(each / size) for each, size in zip(channels, SCALE, strict=True)]
    return TouchRecorded.packed(
        array("h", np.concatenate(counts).astype(int).tolist()).tobytes(),
        touch=0,
        source="board",
        rate_hz=float(RATE_HZ),
        first_s=5.0,
        scale=SCALE,
        clock_offset_s=OFFSET_S,
        clock_error_s=1e-3,
        moved_s=(OFFSET_S + 6.0, OFFSET_S + 8.0),
        tare_n=tare_n,
        saturated=0,
    )


def opened(kind: str = "slide") -> SessionOpened:
    study = slide_study(parsed_study(TEXT))
    trials = [
        PlannedTrial(**{**vars(trial), "touches": tuple(t.model_dump() for t in trial.touches)})
        for trial in slide_plan(study).trials
    ]
    return SessionOpened(
        participant=SLIDE,
        session=1,
        kind=kind,
        study="paper",
        slot=None,
        sequence=(),
        conditions=(),
        study_sha256="",
        study_text=TEXT,
        trials=tuple(trials),
        language="en",
        consent=None,
        seed=1,
        versions={},
    )


BEGINNING: list[Event] = [
    DeviceArmed(idn="a board", boot=1, device_time_s=0.0),
    BeamMounted(beam="1 mm"),
    ResonanceMeasured(frequency_hz=24_100.0, tip_m_per_v=1e-8),
]


def made(index: int, volts: float, recording: TouchRecorded | None) -> list[Event]:
    drive = CommandedDrive(voltage_v=volts, frequency_hz=24_100.0, ramp_v_per_s=400.0)
    answer: dict[str, Any] = {"change": None, "agrees": None, "score": None}
    return [
        TrialStarted(index=index, kind="pass"),
        TouchStarted(touch=0, commanded=drive, instruction=None),
        *([] if recording is None else [recording]),
        TouchEnded(touch=0, read_back=(), trace=(), judged=NOT_JUDGED),
        Answered(
            index=index,
            kind="pass",
            condition="x",
            level=1.0,
            opposite=False,
            reaction_time_s=(),
            traces=(),
            judged=(),
            **answer,
        ),
    ]


def session(*parts: Sequence[Event], first: Event | None = None) -> DrawnSession:
    events = [first or opened(), *BEGINNING, *(event for part in parts for event in part)]
    return drawn_session(
        [
            StoredEvent(
                seq=seq,
                tag=event.TAG,
                utc=datetime(2026, 1, 1, tzinfo=UTC),
                monotonic_s=float(seq),
                payload=event.to_json(),
            )
            for seq, event in enumerate(events)
        ]
    )


def test_a_pass_is_what_was_measured_while_the_mark_moved() -> None:
    found = session(made(0, 0.0, recorded(0.4)), made(1, 100.0, recorded(0.5)))
    assert (found.session, found.rehearsal, len(found.planned)) == ("slide/1", False, 2)
    assert (found.resonance.frequency_hz, found.idn) == (24_100.0, "a board")
    rest, driven = (each.made for each in found.passes)
    assert [each.drive for each in found.passes] == ["reference, 0 V", "1 x resonance"]
    assert (rest.voltage_v, driven.voltage_v, driven.frequency_hz) == (0.0, 100.0, 24_100.0)
    assert (driven.load_n, driven.contact_m, driven.direction) == (0.7, 0.010, "right")
    assert driven.t_s.size == pytest.approx(2 * RATE_HZ, abs=10)
    assert driven.t_s[0] == pytest.approx(OFFSET_S + 6.0, abs=0.05)
    assert driven.x_m[[0, -1]] == pytest.approx([0.010, 0.081], abs=2e-3)
    assert rest.mu == pytest.approx(0.4, abs=2e-3), "without the sensors' zeros"
    assert driven.mu == pytest.approx(0.5, abs=2e-3)


def test_a_block_that_waits_counts_only_while_it_moves() -> None:
    late = recorded(0.5, begins_s=1.5, lasts_s=1.0)
    made_late = session(made(0, 0.0, recorded()), made(1, 100.0, late)).passes[1].made
    assert made_late.t_s[0] == pytest.approx(OFFSET_S + 6.5, abs=0.05)
    assert made_late.t_s[-1] == pytest.approx(OFFSET_S + 7.5, abs=0.05)
    assert np.ptp(made_late.x_m) == pytest.approx(0.071, abs=4e-3)


def test_a_pass_without_a_zero_of_its_own_has_the_one_before_it() -> None:
    found = session(made(0, 0.0, recorded()), made(1, 100.0, recorded(0.5, tare_n=None)))
    assert found.passes[1].made.mu == pytest.approx(0.5, abs=2e-3)


def test_the_last_attempt_counts() -> None:
    broken_off = [*made(0, 0.0, recorded(0.9))[:-1], TrialAborted(index=0, why="repeated")]
    found = session(broken_off, made(0, 0.0, recorded(0.4)))
    (only,) = found.passes
    assert only.made.mu == pytest.approx(0.4, abs=2e-3)


@pytest.mark.parametrize(
    ("recording", "why"),
    [
        (None, "nothing was recorded"),
        (recorded(load_n=0.0), "the block was not on the beam"),
        (recorded(moves_m=0.0), "the block did not move"),
        (recorded(moves_m=-0.071), "the block went back"),
        (replace(recorded(), sha256="0" * 64), "samples differ from their digest"),
    ],
)
def test_a_pass_that_tells_nothing_is_left_out_with_its_reason(
    recording: TouchRecorded | None, why: str
) -> None:
    found = session(made(0, 0.0, recorded()), made(1, 100.0, recording))
    assert [each.index for each in found.passes] == [0]
    assert found.left_out == ((1, why),)


def test_an_excluded_pass_is_left_out_until_it_is_included() -> None:
    parts = [made(0, 0.0, recorded()), made(1, 100.0, recorded())]
    over: list[Event] = [DeviceOff(confirmed=True, why=""), SessionCompleted()]
    out: list[Event] = [TrialExcluded(index=1, reason="the block tilted")]
    assert session(*parts, over, out).left_out == ((1, "the block tilted"),)
    back: list[Event] = [TrialIncluded(index=1, reason="it did not")]
    assert session(*parts, over, out, back).left_out == ()


def test_a_rehearsal_is_known_as_such() -> None:
    assert session(made(0, 0.0, recorded()), first=opened("rehearsal")).rehearsal


def test_an_experiment_without_a_pass_is_refused() -> None:
    with pytest.raises(BadInput, match="slide/1: no pass has been made that counts"):
        session()
