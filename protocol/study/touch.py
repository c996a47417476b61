"""A touch: what finger and device do, how long it takes, what slew and current it needs."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, pi
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, ModelWrapValidatorHandler, model_validator

from protocol.study.fields import Count, Name, NotNegative, Positive, Record, Whole, setting
from protocol.study.rig_settings import Rig
from protocol.study.surface import Friction

Direction = Literal["right", "left"]
Coverage = Literal["local", "full"]
Place = Literal["path", "smooth"]
Programme = Literal["hold", "ramp", "sweep", "ramp and sweep"]
OnBeam = Annotated[NotNegative, Field(le=1)]
"""On a beam, m, which is never longer than 1 m; `device.study_limits` knows where this one ends."""


def _leads_right(path_m: tuple[float, float]) -> tuple[float, float]:
    if path_m[0] >= path_m[1]:
        raise ValueError("must lead from left to right")
    return path_m


Way = Annotated[tuple[OnBeam, OnBeam], AfterValidator(_leads_right)]
"""From its left end to its right one."""
SHORTEST_S, LONGEST_S = 0.1, 600.0
"""Of a touch: nothing is felt in less, and nothing may be driven for longer."""
TouchTime = Annotated[Positive, Field(ge=SHORTEST_S, le=LONGEST_S)]
Hertz = Annotated[Positive, Field(ge=20, le=100_000)]
"""Of a drive that does not follow the resonance."""
# Fingers explore at 10 to 200 mm/s; at 1 mm/s nobody slides, at 1 m/s nobody feels.
SlidingSpeed = Annotated[Positive, Field(ge=0.001, le=1)]
"""Of a mark that paces a finger or a block, m/s."""
Relative = Annotated[Positive, Field(ge=0.1, le=10)]
"""To a resonance or a force: a tenth or ten times of it is another experiment."""


class TouchDefaults(Record):
    """How the finger touches unless a trial says otherwise."""

    # Touch is studied at 0.1 to 5 N; 10 N is a finger that carries 1 kg, 0.01 N hardly a touch.
    force_n: Positive = setting(0.5, "force of the finger on the beam", ge=0.01, le=10)
    # A fingertip covers some 10 mm, a probe 1 mm, a flat hand 100 mm.
    contact_m: Positive = setting(0.010, "length of beam under one finger", ge=0.001, le=0.1)
    sliding_speed_m_s: SlidingSpeed = 0.04
    """speed of the mark that paces the finger"""
    path_m: Way = (0.010, 0.081)
    """the finger's way on the beam (0.1 m), right edge of the finger, clamp at 0"""
    smooth_place_m: OnBeam = 0.0414
    """the place to touch without sliding, right edge of the finger"""
    hold_s: TouchTime = setting(2.0, "how long this place is touched")
    # The finger is put on the beam meanwhile; after a minute nobody remembers the instruction.
    lead_in_s: NotNegative = setting(3.0, le=60)
    """how long the mark rests before a touch, with the first drive on; longer if the soft start
    takes longer"""
    countdown: bool = setting(True, "whether 3, 2, 1 is shown during `lead_in_s`", strict=True)
    beam: Name | None = None
    """the beam that is mounted unless a touch names another one of `[beams]`"""


class Touch(Record):
    """One touch of the beam and what the device does meanwhile.

    The programme is a hold, unless `ramp_to_v` lets the amplitude or `sweep_to` the frequency
    change while the finger is on the beam.
    """

    place: Place = Field(description="slide along `touch.path_m`, or touch `touch.smooth_place_m`")
    voltage_v: Annotated[NotNegative, Field(description="amplitude (peak) at the start")]
    ramp_to_v: NotNegative | None = setting(None, "amplitude (peak) at the end of a ramp")
    frequency: Relative = setting(1.0, "frequency of the drive, relative to the measured resonance")
    frequency_hz: Hertz | None = None
    """instead of `frequency`: a drive that does not follow the resonance"""
    sweep_to: Relative | None = setting(None, "frequency at the end of a sweep, likewise relative")
    sweep_to_hz: Hertz | None = setting(None, "instead of `sweep_to`")
    direction: Direction = setting("right", "direction of the sliding finger")
    coverage: Coverage = setting("local", "one finger, or several that cover the beam")
    press: Relative = setting(1.0, "touch force, relative to `touch.force_n`; above 1 is harder")
    beam: Name | None = setting(None, "one of `[beams]`; the operator mounts it first")
    duration_s: TouchTime | None = None
    """instead of `touch.hold_s` or the time the path takes"""
    sliding_speed_m_s: SlidingSpeed | None = None
    """of a slide, instead of `touch.sliding_speed_m_s`"""
    friction: Friction | None = None
    """what a touch of a surface of kind `given` states: its coefficient, from which predictions
    follow"""
    instruction: Name | None = None
    """key of the text that replaces the built-in instruction"""

    @model_validator(mode="wrap")
    @classmethod
    def _fixed_drive_is_recorded(
        cls, values: Any, handler: ModelWrapValidatorHandler[Self]
    ) -> Self:
        """Take what a record has worked out of Hz, which may be far from the resonance."""
        if not isinstance(values, Mapping):
            return handler(values)
        worked_out = {
            key: value
            for key in ("frequency", "sweep_to")
            if values.get(f"{key}_hz") is not None
            and isinstance(value := values.get(key), float)
            and 0 < value < inf
        }
        if not worked_out:
            return handler(values)
        given = {key: value for key, value in values.items() if key not in worked_out}
        return handler(given).model_copy(update=worked_out)

    @property
    def end_voltage_v(self) -> float:
        """Amplitude at the end of the touch, V."""
        return self.voltage_v if self.ramp_to_v is None else self.ramp_to_v

    @property
    def peak_voltage_v(self) -> float:
        """Largest amplitude during the touch, V."""
        return max(self.voltage_v, self.end_voltage_v)

    @property
    def end_frequency(self) -> float:
        """Drive at the end of the touch, relative to the resonance."""
        return self.frequency if self.sweep_to is None else self.sweep_to

    @property
    def peak_frequency(self) -> float:
        """Highest drive during the touch, relative to the resonance."""
        return max(self.frequency, self.end_frequency)

    @property
    def drive_ends(self) -> tuple[str, str]:
        """The drive at start and end as the study gives it: `0.98`, or `23000 Hz`."""
        start = _said(self.frequency, self.frequency_hz)
        return start, start if self.sweep_to is None else _said(self.sweep_to, self.sweep_to_hz)

    @property
    def own_path_m(self) -> tuple[float, float] | None:
        """Ends of a way of its own, m; None where the finger takes that of the study."""
        return None

    @property
    def own_place_m(self) -> float | None:
        """A place of its own to hold, m; None where the finger takes that of the study."""
        return None

    def at(self, resonance_hz: float) -> Self:
        """Return the touch on a beam of this resonance: what is in Hz becomes relative to it."""
        hertz = {"frequency": self.frequency_hz, "sweep_to": self.sweep_to_hz}
        relative = {key: hz / resonance_hz for key, hz in hertz.items() if hz is not None}
        if not relative:
            return self
        found = self.model_copy(update=relative)
        # What was worked out was not given, and the study file's own keys must stay known.
        found.model_fields_set.intersection_update(self.model_fields_set)
        return found

    @property
    def programme(self) -> Programme:
        """What the device does during the touch."""
        if self.ramp_to_v is None:
            return "hold" if self.sweep_to is None else "sweep"
        return "ramp" if self.sweep_to is None else "ramp and sweep"


def _said(relative: float, hertz: float | None) -> str:
    return f"{relative:g}" if hertz is None else f"{hertz:g} Hz"


def touch_s(touch: Touch, finger: TouchDefaults) -> float:
    """Return how long the finger is on the beam, s."""
    if touch.duration_s is not None:
        return touch.duration_s
    if touch.place == "smooth":
        return finger.hold_s
    left_m, right_m = touch.own_path_m or finger.path_m
    return (right_m - left_m) / (touch.sliding_speed_m_s or finger.sliding_speed_m_s)


@dataclass(frozen=True, kw_only=True)
class Mark:
    """The touch that a participant is shown: a place to hold or a slide to follow, and its force.

    The mark is at `start_m` and, `duration_s` later, at `end_m`; places are of the finger's right
    edge.
    """

    start_m: float
    end_m: float
    duration_s: float
    force_n: float
    direction: Direction
    harder: bool

    @property
    def slides(self) -> bool:
        """Whether the finger is to move."""
        return self.start_m != self.end_m


def mark_of(touch: Touch, finger: TouchDefaults) -> Mark:
    """Return the mark for `touch`: a place to hold, or a slide at the study's speed."""
    own_m = touch.own_place_m
    start_m = end_m = finger.smooth_place_m if own_m is None else own_m
    if touch.place == "path":
        path_m = touch.own_path_m or finger.path_m
        start_m, end_m = path_m if touch.direction == "right" else path_m[::-1]
    return Mark(
        start_m=start_m,
        end_m=end_m,
        duration_s=touch_s(touch, finger),
        force_n=finger.force_n * touch.press,
        direction=touch.direction,
        harder=touch.press > 1,
    )


def on_s(touch: Touch, finger: TouchDefaults, rig: Rig) -> float:
    """Return how long the device is busy with `touch`: the lead-in, then the touch itself, s.

    The soft start is part of the lead-in. At the end of the touch the output goes off at once.
    """
    return max(finger.lead_in_s, touch.voltage_v / rig.ramp_v_per_s) + touch_s(touch, finger)


def driven_s(touch: Touch, finger: TouchDefaults, rig: Rig) -> float:
    """Return how long the beam is driven for `touch`, lead-in included, s."""
    return on_s(touch, finger, rig) if touch.peak_voltage_v > 0 else 0.0


def slew_v_per_us(voltage_v: float, frequency_hz: float) -> float:
    """Return the largest slope of a sine of this amplitude, 2 pi f V, in V/us.

    >>> round(slew_v_per_us(200, 24_221), 1)
    30.4
    """
    return 2 * pi * frequency_hz * voltage_v * 1e-6


def current_ma(voltage_v: float, frequency_hz: float, capacitance_nf: float) -> float:
    """Return the amplitude of the current into a capacitance, 2 pi f C V, in mA.

    >>> round(current_ma(200, 24_221, 1.0))
    30
    """
    return slew_v_per_us(voltage_v, frequency_hz) * capacitance_nf


# The sliding experiment (paper, section 5.1): a block is drawn along the driven beam.

MOST_PASSES = 200
"""In one experiment: it takes an hour or more."""
_AROUND_RESONANCE = (0.98, 0.99, 0.995, 1.0, 1.005, 1.01, 1.02)


class Slide(Record):
    """What is drawn along the beam, how, and how often.

    Each drive is combined with each path, speed and direction. A pass is one of these drawings.
    """

    # A block of 1 g hardly touches; the scale of the force ends at 10 N.
    load_n: Positive = setting(0.56, "weight of the block and of what lies on it", ge=0.01, le=10)
    contact_m: Positive = setting(0.010, "length of beam under the block", ge=0.001, le=0.1)
    voltage_v: Positive = setting(100.0, "amplitude (peak) of every driven pass")
    # Friction at 23,200 Hz, the paper's only drive, hardly depends on the damping: a fit needs
    # passes on both sides of the resonance.
    frequencies: tuple[Relative, ...] = setting(_AROUND_RESONANCE, max_length=50)
    """frequencies of the drives, relative to the measured resonance"""
    frequencies_hz: tuple[Hertz, ...] = setting((23_200.0,), max_length=50)
    """fixed frequencies of further drives, in Hz; by default none on a surface of one's own"""
    references: Whole = setting(3, le=50)
    """how often the block is drawn without a drive (0 V), spread from first to last"""
    repeats: Count = setting(1, le=20)
    """how often each driven pass is made; all come once before one comes again"""
    directions: tuple[Direction, ...] = setting(("right",), min_length=1, max_length=2)
    """directions of the block"""
    speeds_m_s: tuple[SlidingSpeed, ...] = setting(
        (0.005,), "speeds of the mark that paces the block", min_length=1, max_length=10
    )
    paths_m: tuple[Way, ...] = setting(((0.010, 0.081),), min_length=1, max_length=20)
    """where the block is drawn (its right edge, clamp at 0): the whole way, or parts around places
    of interest; by default `touch.path_m` on a surface of one's own"""
    beam: Name | None = setting(None, "one of `[beams]`, instead of `touch.beam`")

    @model_validator(mode="after")
    def _has_passes(self) -> Self:
        if not self.frequencies and not self.frequencies_hz:
            raise ValueError("frequencies must hold some where frequencies_hz has none, got none")
        listed = ("frequencies", "frequencies_hz", "directions", "speeds_m_s", "paths_m")
        for key in listed:
            values = getattr(self, key)
            # A drive that stands twice would be counted as two passes that nothing tells apart.
            if twice := [value for value in values if values.count(value) > 1]:
                raise ValueError(f"{key} must hold no value twice, got {twice[0]} twice")
        if self.passes > MOST_PASSES:
            raise ValueError(f"must have at most {MOST_PASSES} passes, got {self.passes}")
        # The extremes are checked because each path is combined with each speed.
        lengths_m = [right_m - left_m for left_m, right_m in self.paths_m]
        shortest_s = min(lengths_m) / max(self.speeds_m_s)
        longest_s = max(lengths_m) / min(self.speeds_m_s)
        if shortest_s < SHORTEST_S or longest_s > LONGEST_S:
            raise ValueError(
                f"a pass must take {SHORTEST_S:g} to {LONGEST_S:g} s, "
                f"got {shortest_s:.4g} to {longest_s:.4g} s"
            )
        return self

    @property
    def passes(self) -> int:
        """How often the block is drawn, references included."""
        drives = len(self.frequencies) + len(self.frequencies_hz)
        ways = len(self.paths_m) * len(self.speeds_m_s) * len(self.directions)
        return ways * (self.references + drives * self.repeats)

    def finger(self, usual: TouchDefaults) -> TouchDefaults:
        """Return how the block touches; lead-in and beam are those of the study's `usual` touch."""
        return usual.model_copy(
            update={
                "force_n": self.load_n,
                "contact_m": self.contact_m,
                "sliding_speed_m_s": self.speeds_m_s[0],
                "path_m": self.paths_m[0],
                "beam": self.beam or usual.beam,
            }
        )


class SlidePass(Touch):
    """One drawing of the block; its duration follows from path and speed."""

    path_m: Annotated[Way, Field(description="where the block is drawn")]
    voltage_v: Annotated[NotNegative, Field(description="amplitude (peak), 0 in a reference")]

    @property
    def own_path_m(self) -> tuple[float, float]:
        """Ends of the block's way, m."""
        return self.path_m
