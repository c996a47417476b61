"""The power stage of every simulated device: output, slew, watchdog and protection; its clock.

The stage has no clock of its own: device time and wall time are handed in.
"""

from collections.abc import Callable
from dataclasses import dataclass

MAX_VOLTAGE_V = 200.0
FREQUENCY_RANGE_HZ = (1.0, 100_000.0)
RAMP_RANGE_V_PER_S = (1e-3, 2_000.0)
"""The upper end is the slew limit of the board: no command makes the amplitude move faster."""
DEFAULT_RAMP_V_PER_S = 400.0
DEFAULT_FREQUENCY_HZ = 1_000.0
WATCHDOG_RANGE_S = (0.05, 10.0)
# Between the 90% and 100% that docs/reference/wire-protocol.md asks of a board.
WATCHDOG_MARGIN = 0.95
"""A watchdog promises 0 V within its time: it trips when this fraction of it was silent."""
COOL_C, HOT_C = 31.0, 96.0


@dataclass(kw_only=True)
class FrequencySweep:
    """The frequency moves from one to another in a time, and stays there."""

    start_hz: float = DEFAULT_FREQUENCY_HZ
    stop_hz: float = DEFAULT_FREQUENCY_HZ
    begin_s: float = 0.0
    duration_s: float = 1.0

    def at(self, time_s: float) -> float:
        done = min(max((time_s - self.begin_s) / self.duration_s, 0.0), 1.0)
        return self.start_hz + done * (self.stop_hz - self.start_hz)


@dataclass
class Instrument:
    """The state of a device. `time_s` is its own clock; `cause` says why protection tripped."""

    boot: int = 1
    time_s: float = 0.0
    output: bool = False
    target_v: float = 0.0
    voltage_v: float = 0.0
    frequency_hz: float = DEFAULT_FREQUENCY_HZ
    sweep: FrequencySweep | None = None
    ramp_v_per_s: float = DEFAULT_RAMP_V_PER_S
    limit_v: float = MAX_VOLTAGE_V
    watchdog_s: float | None = None
    cause: str = "NONE"
    hot: bool = False
    off_ignored: bool = False
    relay_stuck: bool = False
    watchdog_dead: bool = False
    left_v: float = 0.0
    """What is at the output although it is off: 0 unless something is broken."""
    set_gain: float = 1.0
    """What is kept of a drive, relative to what was asked: 1 unless something is broken."""
    stage_gain: float = 1.0
    """What comes out, relative to what is meant: 1 unless something is broken."""
    scale: float = 1.0
    """What it takes itself to give, relative to what was set: 1 unless something is broken."""
    heard_wall_s: float = 0.0
    tripped_wall_s: float | None = None

    @property
    def tripped(self) -> bool:
        """Whether protection has turned the output off and not been cleared."""
        return self.cause != "NONE"

    @property
    def meant_v(self) -> float:
        """The amplitude that the device takes itself to give, V."""
        return self.scale * self.voltage_v

    @property
    def output_v(self) -> float:
        """The amplitude that is on the beam in truth, V."""
        return self.stage_gain * self.meant_v + self.left_v

    def output_at(self, time_s: float) -> float:
        """Return the amplitude on the beam at a device time to come, if nothing else happens, V."""
        return self.stage_gain * self.scale * self._moved_v(time_s) + self.left_v

    def _moved_v(self, time_s: float) -> float:
        """Return the amplitude that the slew has reached at a device time to come."""
        if not self.output:
            return self.voltage_v
        step_v = self.ramp_v_per_s * max(time_s - self.time_s, 0.0)
        return self.voltage_v + max(-step_v, min(step_v, self.target_v - self.voltage_v))

    @property
    def temperature_c(self) -> float:
        return HOT_C if self.hot else COOL_C

    def advance_to(self, time_s: float) -> None:
        """Let device time pass: the amplitude moves on its slew, the frequency on its sweep."""
        if self.output:
            self.voltage_v = self._moved_v(time_s)
        # Device time never runs backwards, whatever the wall clock does.
        self.time_s = max(time_s, self.time_s)
        if self.sweep is not None:
            self.frequency_hz = self.sweep.at(self.time_s)

    def switch(self, on: bool) -> None:
        """Control the output; off is immediate, on starts from 0 V."""
        if self.off_ignored and not on:
            return
        if self.relay_stuck and not on:
            # The voltage of the first off stays: a second one finds 0 V set.
            self.left_v = max(self.left_v, self.voltage_v)
        # Only when it changes: `OUTP ON` at an output that is on must not drop the amplitude.
        if on != self.output:
            self.voltage_v = 0.0
        self.output = on

    def silence_left_s(self, wall_s: float) -> float | None:
        """Return how long the host may still be silent; None while nothing depends on it."""
        # The host may be silent for as long as it likes while the output is off.
        if not self.output or self.watchdog_s is None or self.watchdog_dead:
            return None
        return self.heard_wall_s + WATCHDOG_MARGIN * self.watchdog_s - wall_s

    def watch(self, wall_s: float) -> None:
        """Trip if the host was silent for longer than it promised."""
        left_s = self.silence_left_s(wall_s)
        if left_s is not None and left_s <= 0:
            self.trip("WATC", wall_s)

    def trip(self, cause: str, wall_s: float) -> None:
        """Cut the power stage, because of `WATC` or `TEMP`, behind the output's own switch."""
        # Not by `switch`, so that no fault of the switch keeps protection from it.
        self.voltage_v, self.output = 0.0, False
        self.cause, self.tripped_wall_s = cause, wall_s

    def reset(self) -> None:
        """Go back to what `*RST` gives: off, 0 V, no watchdog; boot counter and trip stay."""
        self.switch(on=False)
        self.target_v, self.frequency_hz, self.sweep = 0.0, DEFAULT_FREQUENCY_HZ, None
        self.ramp_v_per_s, self.limit_v = DEFAULT_RAMP_V_PER_S, MAX_VOLTAGE_V
        self.watchdog_s = None

    def restart(self) -> None:
        self.voltage_v, self.output = 0.0, False
        self.reset()
        self.cause = "NONE"
        self.boot += 1


class DeviceClock:
    """Seconds since the device started."""

    def __init__(self, wall_s: Callable[[], float]) -> None:
        self._wall_s = wall_s
        self._started_s = wall_s()
        self._stepped_s: float | None = None

    def now_s(self) -> float:
        return self._stepped_s if self._stepped_s is not None else self._wall_s() - self._started_s

    def step(self, seconds: float) -> None:
        """Let `seconds` pass at once; from the first step on no other time passes."""
        if not 0 <= seconds < float("inf"):
            raise ValueError(f"a step must be 0 s or more, got {seconds}")
        self._stepped_s = self.now_s() + seconds
