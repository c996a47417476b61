"""Records within events: a planned trial, the drive, what was read back, and its judgement."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from protocol.journal.json_record import JsonRecord, Key


@dataclass(frozen=True, kw_only=True)
class PlannedTrial(JsonRecord):
    """A trial as it was planned, with what its touches are to be."""

    index: Annotated[int, Key("number of the trial in its session, from 0")]
    block: Annotated[int, Key("number of its block, 0 before the first one", missing=0)]
    kind: Annotated[str, Key("`baseline`, `signal`, `practice`, `trial` or `catch`")]
    condition: Annotated[str | None, Key("name of its condition, if it has one")]
    question: Annotated[str | None, Key("what is asked after it, if anything", missing=None)]
    expected: Annotated[str | None, Key("the answer that the study expects", missing=None)]
    scored: Annotated[bool, Key("whether a score may be asked for", missing=False)]
    touches: Annotated[
        tuple[Mapping[str, Any], ...],
        Key("its touches, with the keys of a touch in [study-file.md](study-file.md)", missing=()),
    ]
    level: Annotated[float, Key("what its condition's amplitudes were multiplied by", missing=1.0)]
    opposite: Annotated[bool, Key("whether its touches come in the opposite order", missing=False)]
    break_s: Annotated[float, Key("least break before it, s", missing=0.0)]


@dataclass(frozen=True, kw_only=True)
class CommandedDrive(JsonRecord):
    """The drive that the device is set to as a touch begins."""

    voltage_v: Annotated[float, Key("amplitude (peak), V")]
    frequency_hz: Annotated[float, Key("frequency, Hz")]
    ramp_v_per_s: Annotated[float, Key("how fast the amplitude moves there, V/s")]


@dataclass(frozen=True, kw_only=True)
class ReadBack(JsonRecord):
    """The drive as the device reports it, its monitor and its sensors, where it has them."""

    output: Annotated[bool, Key("whether the output is on")]
    voltage_v: Annotated[float, Key("amplitude (peak), V")]
    frequency_hz: Annotated[float, Key("frequency, Hz")]
    monitor_v: Annotated[float | None, Key("amplitude that the monitor measures, V", missing=None)]
    force_n: Annotated[float | None, Key("force of the finger, N", missing=None)]
    position_m: Annotated[float | None, Key("position of the finger, m", missing=None)]
    device_time_s: Annotated[float | None, Key("the device's own clock, s", missing=None)]


class TraceSample(NamedTuple):
    """One look at the finger while it touches, in the journal a list of three numbers."""

    t_s: float
    force_n: float
    position_m: float


@dataclass(frozen=True, kw_only=True)
class Compliance(JsonRecord):
    """Whether a touch was as the instruction asked, where the rig felt a finger at all."""

    force_n: Annotated[float | None, Key("median force of the finger, N", missing=None)]
    force_ok: Annotated[bool | None, Key("whether it was the force asked for", missing=None)]
    place_ok: Annotated[bool | None, Key("whether the finger was where it should be", missing=None)]


NOT_JUDGED = Compliance(force_n=None, force_ok=None, place_ok=None)


@dataclass(frozen=True, kw_only=True)
class InstructionResponse(JsonRecord):
    """How the participant got ready for a touch."""

    answer: Annotated[str, Key("`ready`")]
    reaction_time_s: Annotated[float, Key("from the instruction to the answer, s")]
    trace: Annotated[Mapping[str, Any] | None, Key("how it came about, see [window.md](window.md)")]
