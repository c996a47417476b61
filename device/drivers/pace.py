"""The pace of a device: how long it takes to answer, and what follows for what it drives."""

import math
from dataclasses import dataclass

SLOW_S = 0.02
"""From which on the operator is told of it: most devices answer within 5 ms."""
_LONGEST_WATCHDOG_S = 5.0
"""The largest `rig.watchdog_s`."""


@dataclass(frozen=True, kw_only=True)
class Pace:
    """Seconds that a device takes, as measured while nothing is driven.

    Attributes:
        answer_s: for one line, until its answer.
        watch_s: between two looks at the session, or between two lines that feed a watchdog.
        begin_s: at most, until a drive that was asked for has begun.
        end_s: at most, until the output is off, and read back.
        late_s: at most, that a touch lasts longer than planned, if its drive stays as it is.
        step_s: for a step of a ramp; 0 for a device that makes its ramps itself.
    """

    answer_s: float
    watch_s: float
    begin_s: float
    end_s: float
    late_s: float
    step_s: float = 0.0

    def too_slow(self, watchdog_s: float, longest_s: float) -> str:
        """Return why nothing can be driven, with what to do; '' for a device that is fast enough.

        It must be heard of within `watchdog_s`, and begin a drive within `longest_s`.
        """
        if self.begin_s > longest_s:
            why = f"a drive would take up to {self.begin_s:.1f} s to begin, {longest_s:g} s at most"
            remedy = "use a faster connection, such as its LAN socket, or another generator"
        elif self.watch_s > watchdog_s:
            least_s = math.ceil(12 * self.watch_s) / 10
            why = f"watching it takes {self.watch_s:.3g} s, and rig.watchdog_s is {watchdog_s:g}"
            remedy = "use a faster connection, such as its LAN socket"
            if least_s <= _LONGEST_WATCHDOG_S:
                remedy += f", or set rig.watchdog_s to {least_s:g} or more"
        else:
            return ""
        return f"the device takes {self._answer} to answer, which is too slow: {why}; {remedy}"

    def too_late(self, most_s: float, *, changing: bool) -> str:
        """Return why a touch would not end within `most_s` of its time, '' if each does.

        A `changing` drive, a ramp or a sweep, is set once more while the touch lasts.
        """
        late_s = self.late_s + self.begin_s * changing
        if late_s <= most_s:
            return ""
        kind = "touches with a ramp or a sweep" if changing else "touches"
        return (
            f"the device takes {self._answer} to answer, so that {kind} would last up to "
            f"{late_s:.1f} s longer than planned, and one that lasts {most_s:g} s longer does not "
            "count; use a faster connection, such as its LAN socket"
        )

    def remark(self, ramp_v_per_s: float, max_voltage_v: float) -> str:
        """Return what the operator must know of a device that is slow, '' for one that is not."""
        if self.answer_s < SLOW_S:
            return ""
        step_v = min(ramp_v_per_s * self.step_s, max_voltage_v)
        steps = f", and a soft start rises in steps of up to {step_v:.0f} V" if step_v else ""
        return (
            f"this device takes {self._answer} to answer: a drive begins up to {self.begin_s:.1f} "
            f"s and ends up to {self.end_s:.1f} s late{steps}"
        )

    @property
    def _answer(self) -> str:
        return f"{1e3 * self.answer_s:.0f} ms"
