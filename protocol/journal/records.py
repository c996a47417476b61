"""Records within events, and those that device and sessions share: drive and read-back."""

import zlib
from base64 import b64decode, b64encode
from collections.abc import Mapping
from hashlib import sha256
from typing import Any, NamedTuple, Self

from protocol.journal.json_record import JsonRecord, absent, key, sparse


class PlannedTrack(JsonRecord):
    """What a trial of a track is for. Its level follows from the answers before it."""

    name: str = key("name of the track")
    role: str = key("`level`: the method chooses it; `easy`: the easiest one; `catch`: none")
    interval: int | None = key()
    """which touch is the comparison, from 1; null if none is, or in yes or no"""


class TrackAnswer(PlannedTrack):
    """The level that a trial of a track was made at, and whether its answer was right."""

    level: int | None = key("number of the level, 0 the hardest; null in a catch trial")
    value: float | None = key("the level in the unit of the axis, likewise")
    correct: bool | None = key()
    """whether the answer was right, in yes or no whether it was yes; null if none is right"""


class PlannedTrial(JsonRecord):
    """A trial as planned, with its touches."""

    index: int = key("number of the trial in its session, from 0")
    block: int = key("number of its block, 0 before the first one", missing=0)
    kind: str = key("`baseline`, `signal`, `practice`, `trial`, `catch`, `track` or `pass`")
    condition: str | None = key("name of its condition, if it has one; drive of a pass")
    question: str | None = key("the question after it, if any", missing=None)
    expected: str | None = key("the answer that the study expects", missing=None)
    scored: bool = key(missing=False)
    """whether a score may be asked for that counts; in a catch trial without a question one is
    asked that does not"""
    touches: tuple[Mapping[str, Any], ...] = key(missing=())
    """its touches, with the keys of a touch in [the study file](../study-file.md)"""
    level: float = key("factor on its condition's amplitudes", missing=1.0)
    opposite: bool = key("whether its touches come in the opposite order", missing=False)
    break_s: float = key("shortest break before it, s", missing=0.0)
    track: PlannedTrack | None = sparse("of a track: what it is for; its touches have no level yet")


class VirtualTruth(JsonRecord):
    """Parameters of a virtual participant and of the simulated beam that it touches.

    score = bias + gain · |felt change of log friction| + what this kind of change adds + noise, on
    the paper's scale of 0 to 10. What is a parameter of `Person` is explained there.
    """

    bias: float = key()
    gain: float = key()
    felt_noise: float = key()
    criterion: float = key()
    rating_noise: float = key()
    law: str = key("law of the simulated beam's friction")
    rung: str = key("rung of the simulated beam's motion")
    force_factor: float = absent(1.0)
    speed_factor: float = absent(1.0)
    place_offset_m: float = absent(0.0)
    tremor: float = absent(0.0)
    skin: float = absent(1.0)
    mu0: float = absent(1.0)
    damping_ratio: float | None = absent(None)
    """damping ratio of the simulated beam, if that is known"""
    beam_gain: float | None = absent(None, "part of the amplitude that reaches it, likewise")
    criterion_less: float | None = absent(None)
    lapse: float = absent(0.0)
    beyond_swing: float = absent(0.0)
    beyond_strength: float = absent(0.0)
    beyond_ramp: float = absent(0.0)
    beyond_swap: float = absent(0.0)
    beyond_press: float = absent(0.0)
    ceiling: float = absent(10.0)
    number_step: float = absent(1.0)
    end_aversion: float = absent(0.0)
    serial: float = absent(0.0)
    adaptation: float = absent(0.0)
    drift: float = absent(0.0)
    fatigue: float = absent(0.0)
    force_error: float = absent(0.0)
    speed_error: float = absent(0.0)
    reaction_shift_s: float | None = absent(None)
    reaction_median_s: float | None = absent(None)
    reaction_spread: float | None = absent(None)
    dropout: float = absent(0.0)
    effect: Mapping[str, float] | None = sparse(
        "points by which each condition changes a score, where friction is not known"
    )

    @property
    def sensitivity(self) -> float:
        """Score points per unit of predicted change, of which its skin makes a felt one."""
        return self.gain * self.skin


class RigCalibration(JsonRecord):
    """What predictions take of the rig, as a sliding experiment determined it."""

    damping_ratio: float = key("damping ratio of the beam")
    gain: float = key("volts at the beam per volt of the drive")
    body_height_m: float = key("height of the ciliary bodies, m")
    resonance_hz: float | None = key("resonance, Hz; null if not determined")
    origin: str = key("session and digest of the calibration")


class Identity(JsonRecord):
    """The device's identity, boot count and clock, and remarks for the operator."""

    idn: str = key("its answer to `*IDN?`")
    boot: int | None = key("number of times it has booted, if it counts", missing=None)
    device_time_s: float | None = key("its own clock, s", missing=None)
    dialect: str = absent("board", "its command dialect")
    cleared_errors: tuple[str, ...] = absent((), "earlier errors, cleared from its error queue")
    remarks: tuple[str, ...] = absent((), "remarks for the operator")


class CommandedDrive(JsonRecord):
    """The drive to which the device is set."""

    voltage_v: float = key("amplitude (peak), V")
    frequency_hz: float = key("frequency, Hz")
    ramp_v_per_s: float = key("rate at which the amplitude ramps, V/s")


class ReadBack(JsonRecord):
    """The drive, monitor and sensor readings that the device reports, as far as it has them."""

    output: bool = key("whether the output is on")
    voltage_v: float = key("amplitude (peak), V")
    frequency_hz: float = key("frequency, Hz")
    monitor_v: float | None = absent(None, "measured by the monitor, V")
    force_n: float | None = absent(None, "force of the finger, N")
    position_m: float | None = absent(None, "position of the finger, m")
    device_time_s: float | None = absent(None, "the device's own clock, s")


class TraceSample(NamedTuple):
    """One sample of the finger during a touch; in the journal, a list of three numbers."""

    t_s: float
    force_n: float
    position_m: float


LIFTED_N = 0.02
"""Force below which a sample counts as not touching; about the noise of a force sensor."""


class Compliance(JsonRecord):
    """Whether a touch was as instructed, if the rig detected a finger at all."""

    force_n: float | None = key("median force of the finger, N", missing=None)
    force_ok: bool | None = key("whether the force was as instructed", missing=None)
    place_ok: bool | None = key("whether the finger was where it should be", missing=None)
    speed_ok: bool | None = absent(None, "whether it slid as fast as instructed, if judged")

    @property
    def judged(self) -> bool:
        """Whether the rig detected a finger."""
        return self.force_ok is not None or self.place_ok is not None

    @property
    def missed(self) -> tuple[str, ...]:
        """What was not as instructed, of `force`, `place` and `speed`."""
        judged = {"force": self.force_ok, "place": self.place_ok, "speed": self.speed_ok}
        return tuple(name for name, ok in judged.items() if ok is False)


NOT_JUDGED = Compliance(force_n=None, force_ok=None, place_ok=None)


class QuestionAnswer(JsonRecord):
    """The answer to a question of the study's own."""

    name: str = key("name of the question")
    answer: Any = key("a label's value, a list of them, a number or a text; null if it was skipped")
    reaction_time_s: float = key("from the question to the answer, s")
    trace: Mapping[str, Any] | None = key("how it was given, see [the window](../window.md)")


class InstructionResponse(JsonRecord):
    """How the participant got ready for a touch."""

    answer: str = key("`ready`")
    reaction_time_s: float = key("from the instruction to the answer, s")
    trace: Mapping[str, Any] | None = key("how it was given, see [the window](../window.md)")


# What the force channel recorded during one touch: samples, their clock, and their digest.
#
# Samples are kept as the sensor gave them, in counts of 16 bits. In the journal they are
# compressed (zlib) and written in base64, so that an event stays a line of text.

CHANNELS = ("tangential_n", "normal_n", "position_m")
"""The channels of a recording, in their order."""
BYTES_PER_COUNT = 2
FULL_SCALE = 32_767
"""A count of this size, of either sign, may be a sensor at its limit."""
MOST_COUNTS = 10**6
"""Per channel: more than the longest touch has, 600 s, at the highest rate, 1 kHz."""
_LEVEL = 1  # noise hardly compresses, and level 6 takes four times as long to save a twentieth


class DamagedSamplesError(Exception):
    """Samples that are not those that were recorded."""


class Recording(JsonRecord):
    """The samples of one touch, all channels at one rate, on the clock of their source."""

    source: str = key("what measured: `board`, or the dialect of the gauge")
    rate_hz: float = key("samples per second and channel")
    first_s: float = key("time of the first sample on the source's own clock, s")
    count: int = key("samples per channel")
    scale: tuple[float, ...] = key()
    """size of one count: tangential force (N), normal force (N), position (m)"""
    clock_offset_s: float = key("the session's clock minus the source's, s")
    clock_error_s: float = key()
    """largest error of that, by the shortest round trips at beginning and end, s"""
    moved_s: tuple[float, ...] = key()
    """when the mark began to move and when the touch was over, on the session's clock, s"""
    tare_n: tuple[float, ...] | None = key(missing=None)
    """mean tangential and normal force just before, with nothing on the beam, N; null if something
    was"""
    saturated: int = key("samples in which a channel was at its limit", missing=0)
    sha256: str = key("digest of the samples before compression")
    samples: str = key()
    """16-bit counts, least byte first: all of tangential force, of normal force, of position;
    compressed with zlib, in base64"""

    @classmethod
    def packed(cls, counts: bytes, **known: object) -> Self:
        """Return the recording of `counts`; `known` are the other keys."""
        return cls(
            samples=b64encode(zlib.compress(counts, _LEVEL)).decode("ascii"),
            sha256=sha256(counts).hexdigest(),
            count=len(counts) // (BYTES_PER_COUNT * len(CHANNELS)),
            **known,  # type: ignore[arg-type]
        )

    def counts(self) -> bytes:
        """Return the samples as 16-bit counts, least byte first, one channel after the other.

        A DamagedSamplesError says that they are not those that were recorded.
        """
        # The count is a stranger's in an imported journal: it says how much memory is taken below.
        if not 0 <= self.count <= MOST_COUNTS:  # compressed, they fit into a thousandth of it
            raise DamagedSamplesError(f"samples cannot be {self.count} in number")
        expected = self.count * BYTES_PER_COUNT * len(CHANNELS)
        try:
            unpacker = zlib.decompressobj()
            # One byte more than expected, so that too long a recording is noticed, and no bomb is
            # unpacked.
            counts = unpacker.decompress(b64decode(self.samples, validate=True), expected + 1)
        except (ValueError, zlib.error) as error:
            raise DamagedSamplesError(f"samples cannot be unpacked ({error})") from error
        if len(counts) != expected or sha256(counts).hexdigest() != self.sha256:
            raise DamagedSamplesError("samples differ from their digest")
        return counts


class ImportedRating(JsonRecord):
    """A score of a table, an answer to the question whether something changed as expected, or both.

    Several of one condition are repeats.
    """

    condition: str = key("name of the condition")
    score: float | None = sparse("the score, if it was given")
    answer: str | None = sparse("`expected`, `contrary` or `same`, if it was asked")
    contrast: float | None = sparse(
        "the change of the logarithm of friction that the table predicts, if it does"
    )
