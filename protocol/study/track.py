"""A track: a question that is asked again and again, at levels that a method chooses."""

import re
from math import inf, log10
from typing import Annotated, Any, Literal

from pydantic import Field

from protocol.study.fields import (
    Count,
    Name,
    NotNegative,
    Positive,
    Record,
    Share,
    Whole,
    required,
    setting,
)
from protocol.study.touch import OnBeam, Touch

Task = Literal["two intervals", "three intervals", "yes or no"]
Method = Literal["constant", "staircase", "quest+", "limits"]
Axis = Literal["voltage", "frequency", "contrast", "place"]
Shape = Literal["weibull", "normal"]
Find = Literal["smoother", "rougher", "stronger", "different"]

GUESS_RATE: dict[Task, float] = {"yes or no": 0, "two intervals": 1 / 2, "three intervals": 1 / 3}
"""Share correct by chance; in yes or no, the share of yes without false alarms."""
AXIS_KEY: dict[Axis, str] = {
    "voltage": "voltage_v",
    "frequency": "frequency",
    "contrast": "voltage_v",
    "place": "place_m",
}
"""The key of a touch that an axis fills in; on `contrast`, with the voltage that gives it."""
AXIS_UNITS: dict[Axis, str] = {"voltage": "V", "frequency": "", "contrast": "", "place": "m"}
"""A frequency is one of the resonance, a contrast a difference of logarithms."""
MOST_LEVELS, MOST_TRIALS = 200, 500


class TrackTouch(Touch):
    """A touch of a track: one as elsewhere, at a voltage or a place that the axis may fill in."""

    voltage_v: NotNegative = setting(0.0, "amplitude (peak)")
    place_m: OnBeam | None = None
    """on the axis `place`: where the beam is touched, instead of `touch.smooth_place_m`"""

    @property
    def own_place_m(self) -> float | None:
        """The place that is touched, m."""
        return self.place_m


class Levels(Record):
    """The levels that a track may have: a range with a number of levels, or each of them."""

    first: NotNegative | None = setting(None, "one end", alias="from")
    last: NotNegative | None = setting(None, "the other end", alias="to")
    count: Count | None = setting(None, "number of levels, both ends included", le=MOST_LEVELS)
    spaced: Literal["equal ratios", "equal steps"] = "equal ratios"
    """between neighbours; equal ratios are equal steps in dB"""
    listed: tuple[NotNegative, ...] = setting((), alias="values", max_length=MOST_LEVELS)
    """each level, instead of a range"""

    @property
    def values(self) -> tuple[float, ...]:
        """The levels in the order of the file; none where no range is given, or one from 0 up."""
        first, last, count = self.first, self.last, self.count
        if self.listed or first is None or last is None or count is None or count < 2:
            return self.listed
        shares = [number / (count - 1) for number in range(1, count - 1)]
        if self.spaced == "equal steps":
            inner = [first + share * (last - first) for share in shares]
        elif first and last / first < inf:
            inner = [first * (last / first) ** share for share in shares]
        else:
            return ()
        return (first, *inner, last)  # the ends exactly: a limit may lie there

    @property
    def step_db(self) -> float | None:
        """The distance of neighbours in dB where it is the same everywhere."""
        if self.listed or self.spaced != "equal ratios" or len(self.values) < 2:
            return None
        return abs(decibels(self.values[-1] / self.values[0])) / (len(self.values) - 1)


def decibels(ratio: float) -> float:
    """Return a ratio of amplitudes in dB."""
    return 20 * log10(ratio)


class Stop(Record):
    """When a track ends before its last trial: as soon as one of these is reached."""

    reversals: Count | None = setting(None, "this many reversals, of a staircase or of limits")
    interval_db: Positive | None = None
    """a 95% interval of the threshold that is no wider than this"""


Steps = tuple[Positive, ...]
Range = tuple[NotNegative, NotNegative]
Slope = Annotated[Positive, Field(le=1e6)]
_OF_A_RULE = required(
    re.compile("[1-9] down [1-9] up").fullmatch,
    'must be "N down M up", each from 1 to 9, such as "3 down 1 up"',
)


class Track(Record):
    """A question that is asked again and again, at levels that its method chooses.

    Levels are numbered from 0, the one that is hardest to tell from the standard.
    """

    name: Annotated[Name, Field(description="name in tables and reports")]
    task: Task
    """find the interval with the comparison among two, the different one among three, or say
    whether it was felt"""
    method: Annotated[Method, Field(description="what chooses the level of the next trial")]
    axis: Axis
    """what the levels are: V; a frequency relative to the resonance; the contrast of friction
    against the standard that is predicted for the calibrated rig; m on the beam"""
    levels: Annotated[Levels, Field(description="all levels there are; see below")]
    standard: TrackTouch | None = None
    """the touch with which the comparison is compared; in yes or no, the touch without a stimulus,
    of catch trials"""
    comparison: TrackTouch
    """the touch at a level: the axis fills in the missing key"""
    trials: Annotated[int, Field(ge=1, le=MOST_TRIALS, strict=True)]
    """largest number of trials at levels that the method chooses"""
    find: Find | None = None
    """what participants are asked for: which touch was it, or in yes or no, was it so; by default
    `smoother` in two intervals, else `different`"""
    stop: Stop | None = setting(None, "when the track ends sooner; see below")
    catch: Whole = setting(0, le=100)
    """trials beside these with the standard in every interval, for false alarms"""
    easy: Whole = setting(0, "trials beside these at the easiest level, for lapses", le=100)
    feedback: bool = setting(False, strict=True)
    """whether participants read if they were right, after each trial"""
    threshold_at: Share | None = None
    """the share correct (or of yes) that defines the threshold, of somebody without lapses; by
    default half-way from chance to 1: 0.75, 0.667 or 0.5"""
    start: NotNegative | None = None
    """first level of a staircase, the easiest by default; one of the levels"""
    rule: Annotated[str, _OF_A_RULE] | None = None
    """of a staircase: `"3 down 1 up"` is harder after 3 correct answers and easier after an
    error"""
    step_db: Steps = setting((), max_length=20)
    """steps of a staircase in dB, the next one after each reversal and the last one to the end"""
    step_levels: tuple[Count, ...] = setting((), max_length=20)
    """instead of `step_db`: steps as numbers of levels"""
    up_step_db: Steps = setting((), max_length=20)
    """of a weighted staircase: the steps towards easier levels, where they differ from `step_db`"""
    up_step_levels: tuple[Count, ...] = setting((), "likewise as numbers of levels", max_length=20)
    streak: Literal["consecutive", "cumulative"] = "consecutive"
    """cumulative: an error does not reset the count of correct answers"""
    first_reversal: Literal["by the rule", "1 down 1 up"] = "by the rule"
    """how a staircase moves until its first reversal"""
    slope: tuple[Slope, Slope] | None = None
    """smallest and largest slope that the curve may have: with `weibull` its exponent, 1 to 5 by
    default; with `normal` 1/SD, per unit of the axis"""
    lapse: Range = setting((0.0, 0.08), "of the lapse rate, from least to most")
    false_alarms: Range = (0.02, 0.4)
    """of yes or no: the share of yes without a stimulus, from least to most, that QUEST+ and the
    estimate reckon with"""
    shape: Shape = setting("weibull", "of the curve that QUEST+ and the estimate assume")
    mercy: Whole = setting(0, le=20)
    """of QUEST+: for this many trials after an error no level is harder than that one"""

    @property
    def turns(self) -> bool:
        """Whether a rule moves its level step by step, so that it has reversals."""
        return self.method in {"staircase", "limits"}

    @property
    def found(self) -> Find:
        """What participants are asked for."""
        return self.find or ("smoother" if self.task == "two intervals" else "different")

    @property
    def intervals(self) -> int:
        """The number of touches of a trial."""
        return {"two intervals": 2, "three intervals": 3, "yes or no": 1}[self.task]

    @property
    def share(self) -> float:
        """The share correct that defines the threshold, of somebody without lapses."""
        by_chance = GUESS_RATE[self.task]
        return (1 + by_chance) / 2 if self.threshold_at is None else self.threshold_at

    @property
    def reference(self) -> float:
        """The level of the standard; 0 where the axis begins there."""
        if self.standard is None or self.axis == "contrast":
            return 0.0
        key: Any = getattr(self.standard, AXIS_KEY[self.axis])
        return float(key or 0.0)

    @property
    def values(self) -> tuple[float, ...]:
        """All levels, from the hardest to the easiest: by their distance from the standard."""
        reference = self.reference
        return tuple(sorted(self.levels.values, key=lambda value: abs(value - reference)))

    @property
    def distances(self) -> tuple[float, ...]:
        """What the curve is a function of: how far each level is from the standard."""
        reference = self.reference
        return tuple(abs(value - reference) for value in self.values)

    def on_axis(self, distance: float) -> float:
        """Return what lies so far from the standard, on the side of the levels."""
        reference = self.reference
        return reference + distance if self.values[-1] > reference else reference - distance

    def at(self, index: int, voltage_v: float | None = None) -> TrackTouch:
        """Return the comparison at a level; on the axis `contrast` with the voltage that gives it.

        Raises:
            IndexError: there is no such level.
        """
        if not 0 <= index < len(self.values):
            raise IndexError(f"{self.name}: level {index} of {len(self.values)}")
        value = self.values[index] if self.axis != "contrast" else voltage_v
        return self.comparison.model_copy(update={AXIS_KEY[self.axis]: value})
