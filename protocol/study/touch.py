"""A touch: what finger and device do, how long it takes, what slew and current it needs."""

from dataclasses import dataclass
from math import pi
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field

from protocol.study.fields import Name, NotNegative, Positive, Record
from protocol.study.rig_settings import Rig

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
Relative = Annotated[Positive, Field(ge=0.1, le=10)]
"""To a resonance or a force: a tenth or ten times of it is another experiment."""


class TouchDefaults(Record):
    """How the finger touches unless a trial says otherwise."""

    # Touch is studied at 0.1 to 5 N; 10 N is a finger that carries 1 kg, 0.01 N hardly a touch.
    force_n: Annotated[
        Positive, Field(ge=0.01, le=10, description="force of the finger on the beam")
    ] = 0.5
    # A fingertip covers some 10 mm, a probe 1 mm, a flat hand 100 mm.
    contact_m: Annotated[
        Positive, Field(ge=0.001, le=0.1, description="length of beam under one finger")
    ] = 0.010
    # Fingers explore at 10 to 200 mm/s; at 1 mm/s nobody slides, at 1 m/s nobody feels.
    sliding_speed_m_s: Annotated[
        Positive, Field(ge=0.001, le=1, description="speed of the mark that paces the finger")
    ] = 0.04
    path_m: Annotated[
        Way,
        Field(
            description="the finger's way on the beam (0.1 m), right edge of the finger, clamp at 0"
        ),
    ] = (0.010, 0.081)
    smooth_place_m: Annotated[
        OnBeam, Field(description="the place to touch without sliding, right edge of the finger")
    ] = 0.0414
    hold_s: Annotated[TouchTime, Field(description="how long this place is touched")] = 2.0
    # The finger is put on the beam meanwhile; after a minute nobody remembers the instruction.
    lead_in_s: Annotated[
        NotNegative,
        Field(
            le=60,
            description="how long the mark rests before a touch, with the first drive on; longer "
            "if the soft start takes longer",
        ),
    ] = 3.0
    countdown: Annotated[
        bool, Field(strict=True, description="whether 3, 2, 1 is shown during `lead_in_s`")
    ] = True
    beam: Annotated[
        Name | None,
        Field(description="the beam that is mounted unless a touch names another one of `[beams]`"),
    ] = None


class Touch(Record):
    """One touch of the beam and what the device does meanwhile.

    The programme is a hold, unless `ramp_to_v` lets the amplitude or `sweep_to` the frequency
    change while the finger is on the beam.
    """

    place: Annotated[
        Place, Field(description="slide along `touch.path_m`, or touch `touch.smooth_place_m`")
    ]
    voltage_v: Annotated[NotNegative, Field(description="amplitude (peak) at the start")]
    ramp_to_v: Annotated[
        NotNegative | None, Field(description="amplitude (peak) at the end of a ramp")
    ] = None
    frequency: Annotated[
        Relative, Field(description="frequency of the drive, relative to the measured resonance")
    ] = 1.0
    sweep_to: Annotated[
        Relative | None, Field(description="frequency at the end of a sweep, likewise relative")
    ] = None
    direction: Annotated[Direction, Field(description="direction of the sliding finger")] = "right"
    coverage: Annotated[
        Coverage, Field(description="one finger, or several that cover the beam")
    ] = "local"
    press: Annotated[
        Relative, Field(description="touch force, relative to `touch.force_n`; above 1 is harder")
    ] = 1.0
    beam: Annotated[
        Name | None, Field(description="one of `[beams]`; the operator mounts it first")
    ] = None
    duration_s: Annotated[
        TouchTime | None, Field(description="instead of `touch.hold_s` or the time the path takes")
    ] = None
    instruction: Annotated[
        Name | None, Field(description="key of the text that replaces the built-in instruction")
    ] = None

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
    def own_path_m(self) -> tuple[float, float] | None:
        """Ends of a way of its own, m; None where the finger takes that of the study."""
        return None

    @property
    def fixed_hz(self) -> float | None:
        """Drive that does not follow the resonance, Hz; None where it is relative."""
        return None

    def at(self, resonance_hz: float) -> Self:
        """Return the touch on a beam of this resonance: a fixed drive becomes relative to it."""
        if self.fixed_hz is None:
            return self
        return self.model_copy(update={"frequency": self.fixed_hz / resonance_hz})

    @property
    def programme(self) -> Programme:
        """What the device does during the touch."""
        if self.ramp_to_v is None:
            return "hold" if self.sweep_to is None else "sweep"
        return "ramp" if self.sweep_to is None else "ramp and sweep"


def touch_s(touch: Touch, finger: TouchDefaults) -> float:
    """Return how long the finger is on the beam, s."""
    if touch.duration_s is not None:
        return touch.duration_s
    if touch.place == "smooth":
        return finger.hold_s
    left_m, right_m = touch.own_path_m or finger.path_m
    return (right_m - left_m) / finger.sliding_speed_m_s


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
    start_m = end_m = finger.smooth_place_m
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
