"""Records within events, and what device and sessions share: the drive, what was read back."""

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
class Identity(JsonRecord):
    """Who answered, how often it has booted, its time, and what a person should know of it."""

    idn: Annotated[str, Key("its answer to `*IDN?`")]
    boot: Annotated[int | None, Key("how often it has booted, if it counts", missing=None)]
    device_time_s: Annotated[float | None, Key("its own clock, s", missing=None)]
    dialect: Annotated[str, Key("what it speaks", missing="board")] = "board"
    cleared_errors: Annotated[
        tuple[str, ...], Key("what stood in its error queue before", missing=())
    ] = ()
    remarks: Annotated[tuple[str, ...], Key("what a person should know of it", missing=())] = ()


@dataclass(frozen=True, kw_only=True)
class CommandedDrive(JsonRecord):
    """A drive that the device is set to."""

    voltage_v: Annotated[float, Key("amplitude (peak), V")]
    frequency_hz: Annotated[float, Key("frequency, Hz")]
    ramp_v_per_s: Annotated[float, Key("how fast the amplitude moves there, V/s")]


@dataclass(frozen=True, kw_only=True)
class ReadBack(JsonRecord):
    """The drive as the device reports it, its monitor and its sensors, where it has them."""

    output: Annotated[bool, Key("whether the output is on")]
    voltage_v: Annotated[float, Key("amplitude (peak), V")]
    frequency_hz: Annotated[float, Key("frequency, Hz")]
    monitor_v: Annotated[float | None, Key("measured by the monitor, V", missing=None)] = None
    force_n: Annotated[float | None, Key("force of the finger, N", missing=None)] = None
    position_m: Annotated[float | None, Key("position of the finger, m", missing=None)] = None
    device_time_s: Annotated[float | None, Key("the device's own clock, s", missing=None)] = None


class TraceSample(NamedTuple):
    """One look at the finger while it touches, in the journal a list of three numbers."""

    t_s: float
    force_n: float
    position_m: float


LIFTED_N = 0.02
"""Below this force of a sample the beam is not touched; the noise of a force sensor."""


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
