"""The rig in a session: one owner of the port, which keeps the device's watchdog quiet.

The watchdog is fed only while the session beats: a hang anywhere turns the output off. A fault
turns it off at once, and latches: nothing is driven again before somebody arms the rig anew.

The owner's work is `Rig.step`. On a real device a thread does it in a loop; without the thread
each call does it, and a simulated clock, so that a session can run in one thread.
"""

import contextlib
import math
from collections.abc import Callable
from concurrent.futures import wait
from dataclasses import replace
from typing import NoReturn, TypeVar

from device.drivers.driver import Driver, Reading, driver_of
from device.drivers.limits import Limits, Setpoint
from device.drivers.pace import Pace
from device.errors import DeviceError, EmergencyStop, ForeignDevice, OutputUnknown
from device.force_channel.recording import Forces, Recorder, Samples
from device.gauges.owner import GaugeOwner
from device.guardian import Guardian, Pulse, guardian_of
from device.guardian_process import passed_s
from device.link.codec import encoded
from device.link.link import Link
from device.link.port import open_port
from device.port_owner import PortOwner
from device.resonance import Resonance, resonance
from protocol.errors import BadInput
from protocol.journal.records import Identity, ReadBack

FEEDS_PER_WATCHDOG = 5
RAMP_STEP_S = 0.02
LONGEST_CALL_S = 5.0
"""Longer must no call take: a drive that begins so late is not the one that was planned."""
MOST_BLOCKS = 4
"""Most blocks of samples that are asked for between two calls."""

_Result = TypeVar("_Result")


class Rig(PortOwner):
    """A device whose owner makes its calls one by one; once it was started, for any thread."""

    def __init__(
        self,
        driver: Driver,
        limits: Limits,
        calibration: Resonance | None = None,
        monotonic: Callable[[], float] = passed_s,
        gauge: GaugeOwner | None = None,
        guardian: Guardian | None = None,
    ) -> None:
        """`guardian` watches over a device that has no watchdog of its own."""
        super().__init__()
        self._driver = driver
        self._gauge = gauge
        self._limits = limits
        self._watchdog_s = limits.watchdog_s
        self._calibration = calibration
        self._monotonic = monotonic
        driver.is_guarded = guardian is not None
        self._pulse = Pulse(monotonic, limits.watchdog_s, guardian)
        driver.link.alive = self._pulse.beat
        self.pace: Pace | None = None
        """How fast the device is, as measured when it was armed; None before."""
        self._calls_waited_for = 0
        self._beats = 0
        self._fed_beats = 0
        self._fetched_beats = 0
        self._fed_s = self._alive_s = monotonic()
        self._armed = False
        self._ramping = False
        self._stopping = False

    def start(self) -> None:
        """Give the port to a thread of its own."""
        self._begin("port owner")
        if self._gauge is not None:
            self._gauge.start(on_fault=lambda: self._put(lambda: None))

    @property
    def has_watchdog(self) -> bool:
        """Whether the device turns its output off by itself when it hears nothing."""
        return self._driver.has_watchdog

    @property
    def has_guardian(self) -> bool:
        """Whether a process of its own turns the output off when this program is silent."""
        return self._driver.is_guarded

    @property
    def measures_resonance(self) -> bool:
        """Whether `resonance` drives the beam; else it is the one kept as the rig's calibration."""
        return self._driver.measures_vibration

    @property
    def reading(self) -> Reading | None:
        """The last answers of the device, None before the first; asks it nothing."""
        return self._driver.reading

    def arm(self) -> Identity:
        """Turn the output off, check who answers, set limits and watchdog; forget a fault.

        Raise `DeviceError` if the device is not as it must be, or `OutputUnknown` as `off`.
        """
        identity = self._waited_for(self._arm)
        if self._gauge is not None:
            self._of_gauge(self._gauge.meet)
        return identity

    def resonance(self, near_hz: float, sleep: Callable[[float], None]) -> Resonance:
        """Find the beam's resonance near `near_hz`; the output is off afterwards.

        A device that cannot measure it has the one that was kept as the rig's calibration.
        """
        if self._calibration is not None and not self.measures_resonance:
            return self._calibration

        def settled(seconds: float) -> None:
            """Beat as often as the watchdog is fed: one that is short hears of every wait."""
            pieces = math.ceil(seconds * FEEDS_PER_WATCHDOG / self._watchdog_s)
            for _ in range(pieces):
                self.beat()
                sleep(seconds / pieces)

        self._vibration_m()  # a device that measures none refuses before anything is driven
        try:
            return resonance(self.drive, self._vibration_m, settled, near_hz, self._limits)
        except DeviceError:
            self.read_back()  # one that turned itself off moves nothing: its own reason comes first
            raise
        finally:
            self.off()

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Set `setpoint`, output on, and return what the device says of it.

        Raise `LimitExceeded`, with nothing sent, `DeviceError` for a device that cannot be trusted,
        whose output is off and stays so, and `OutputUnknown` if it does not say that it is.
        """
        self.beat()
        return self._owned(lambda: self._guarded(lambda: self._drive(setpoint)))

    def watchdog_trips(self, meanwhile: Callable[[], None] = lambda: None) -> bool:
        """Return whether the device turns its output off when it hears nothing for a while.

        Nobody should touch the beam: the output is on at 0 V, and off afterwards. `meanwhile` is
        called again and again; an error that it raises stops the test. Raises as `drive`.
        """
        self.beat()
        found = self._put(lambda: self._guarded(self._driver.watchdog_trips))
        try:
            while not wait([found], RAMP_STEP_S).done:
                meanwhile()
        except BaseException:
            self.emergency_stop()
            raise
        return found.result()

    def read_back(self) -> ReadBack:
        return self._owned(lambda: self._guarded(self._read_back))

    def check(self) -> None:
        """Raise `DeviceError` unless the device does what it was told, and did not fail before."""
        self._owned(lambda: self._guarded(self._driver.check))

    def record(self, rate_hz: int, clock_s: Callable[[], float] | None = None) -> None:
        """Record the force channel from now on; what was being recorded is forgotten.

        Samples are fetched while the session beats; `clock_s`, by default the rig's, is related to
        the device's. Raise `CannotRecord` without a force channel, nothing sent, else as `drive`.
        """
        self.beat()
        gauge, clock = self._gauge, clock_s or self._monotonic
        if gauge is None:
            self._owned(lambda: self._guarded(lambda: self._record(rate_hz, clock)))
        else:
            self._of_gauge(lambda: gauge.record(rate_hz, clock))

    def recorded(self) -> Samples:
        """Stop; return everything since `record`, or raise `DeviceError` if samples were lost."""
        self.beat()
        if self._gauge is not None:
            return self._of_gauge(self._gauge.recorded)
        return self._owned(lambda: self._guarded(self._recorded))

    @property
    def forces(self) -> Forces | None:
        """The newest forces, at most some 50 ms old; None while nothing is recorded."""
        recording = self._gauge or self._recording
        return None if recording is None else recording.latest

    def off(self) -> None:
        """Turn the output off, whatever happened before; raise `OutputUnknown` if unconfirmed.

        If the program or the session stood still until then, the next `beat` says so.
        """
        silence = self._silence()
        self._waited_for(lambda: self._off(silence))

    def emergency_stop(self) -> None:
        """Send off now, whatever the port is waiting for; returns at once.

        The call that was in progress, and each one after it, raises `EmergencyStop` until the rig
        is armed anew, or `OutputUnknown` if the device does not confirm.
        """
        self._stopping = True
        self._driver.link.stop()
        self._put(lambda: None)

    def beat(self) -> None:
        """Say that the session is alive; wait for the owner if samples are fetched too late.

        Raise `DeviceError` if the device failed since the last beat, or this program or the session
        stood still while the output was on.
        """
        if self._fault is not None:
            raise self._fault
        self._lives()
        self._beats += 1
        recording = self._recording
        if recording is not None and recording.is_late():
            self._owned(lambda: None)
        if self._gauge is not None:
            self._gauge.keep_up()

    def close(self) -> None:
        """End the thread and give the port back, output off; raises `OutputUnknown` as `off`."""
        try:
            if self._driver.driven is not None:
                self.off()
        finally:
            self._end()
            self._pulse.close()
            self._driver.close()
            if self._gauge is not None:
                self._gauge.close()

    def idle_s(self) -> float | None:
        now_s = self._monotonic()
        waits = [RAMP_STEP_S] if self._ramping else []
        if self._recording is not None:
            beaten = self._beats != self._fetched_beats
            waits.append(max(self._recording.wait_s(), 0.0 if beaten else RAMP_STEP_S))
        if self._armed and not self._ramping:
            waits.append(max(self._feed_due_s - now_s, 0.0))
        return min(waits, default=None)

    def _make(self, call: Callable[[], None]) -> None:
        self._stop_if_asked()
        call()

    def _go_on(self) -> None:
        self._stop_if_asked()
        self._pulse.beat()
        with contextlib.suppress(DeviceError):  # it is latched: the next beat raises it
            self._guarded(self._keep_going)

    def _vibration_m(self) -> float:
        return self._owned(lambda: self._guarded(self._driver.vibration_m))

    def _owned(self, work: Callable[[], _Result]) -> _Result:
        self._lives()
        return self._waited_for(work)

    def _waited_for(self, work: Callable[[], _Result]) -> _Result:
        self._calls_waited_for += 1
        try:
            return self._put(work).result()
        finally:
            self._alive_s = self._monotonic()
            self._calls_waited_for -= 1

    def _lives(self) -> None:
        """The session lives; what was on while it did not move is turned off.

        The owner may not have had the time to notice: it stood still, too. A device with a watchdog
        is off by then.
        """
        if self._silence():
            self._put(lambda: self._guarded(self._require_session)).result()
        self._alive_s = self._monotonic()

    def _silence(self) -> str:
        """Return that the session did not move for too long, or ''."""
        if self._driver.driven is None or self._driver.has_watchdog or self._calls_waited_for:
            return ""  # nothing is on, or the device sees to it, or the session cannot beat
        silent_s = self._monotonic() - self._alive_s
        too_long = silent_s > self._watchdog_s
        return f"the session did not move for {silent_s:.1f} s while the output was on" * too_long

    def _of_gauge(self, work: Callable[[], _Result]) -> _Result:
        """Return what the gauge gives; one that fails is a fault as any other."""
        try:
            return work()
        except DeviceError as error:
            failed = error
        return self._owned(lambda: self._guarded(lambda: _raised(failed)))

    # What follows is the owner's work.

    def _keep_going(self) -> None:
        """What is due: the ramp's next step, samples, and the watchdog's next feed."""
        if self._gauge is not None:
            if self._owner is None:  # nor has the gauge a thread
                self._gauge.step()
            self._gauge.require_sound()
        if self._ramping:
            self._ramping = self._driver.carry_on()
        if self._monotonic() >= self._feed_due_s:
            self._fed_s = self._monotonic()
            if self._armed:
                self._feed()
        if self._recording is not None and self._beats != self._fetched_beats:
            self._fetch(self._recording)

    @property
    def _feed_due_s(self) -> float:
        return self._fed_s + self._watchdog_s / FEEDS_PER_WATCHDOG

    def _fetch(self, recording: Recorder) -> None:
        """Ask for the blocks that are due, until the device must be looked at.

        It feeds the watchdog too, so that it is done only if the session moved since the last time.
        """
        beats = self._beats
        for _ in range(MOST_BLOCKS):
            if recording.wait_s() > 0 or self._monotonic() >= self._feed_due_s:
                return
            self._fetched_beats = beats
            recording.fetch()

    def _record(self, rate_hz: int, clock_s: Callable[[], float]) -> None:
        self._recording = Recorder(self._driver.force_source(), rate_hz, clock_s)

    def _feed(self) -> None:
        """See that the device does what it was told, which feeds its watchdog.

        What is driven while the session does not move is not looked at: the device's watchdog
        ends it. Where the device has none, the owner is the watchdog.
        """
        self._require_session()
        moved, self._fed_beats = self._beats != self._fed_beats, self._beats
        if moved or self._driver.driven is None:
            self._driver.check()

    def _require_unbroken(self) -> None:
        self._pulse.beat()
        if why := self._pulse.broken():
            if self._driver.has_watchdog:
                self._driver.check()  # its own reason comes first
            raise DeviceError(why)

    def _require_session(self) -> None:
        self._require_unbroken()  # of all of the program says more than of the session
        if why := self._silence():
            raise DeviceError(why)

    def _arm(self) -> Identity:
        self._fault, self._armed, self._ramping, self._recording = None, False, False, None
        self._driver.link.go_on()
        identity: Identity = self._guarded(self._met)
        self._guarded(self._pulse.start)
        self._pulse.release()
        self._armed = True
        return identity

    def _met(self) -> Identity:
        """Arm the device; raise `DeviceError` for one that is too slow to be watched."""
        identity = self._driver.arm()
        pace = self._driver.pace()
        if self._too_slow(pace):  # or this computer was busy just then
            pace = self._driver.pace()
        if why := self._too_slow(pace):
            raise DeviceError(f"{why}; nothing was driven")
        self.pace = pace
        if remark := pace.remark(self._limits.ramp_v_per_s, self._limits.max_voltage_v):
            return replace(identity, remarks=(*identity.remarks, remark))
        return identity

    def _too_slow(self, pace: Pace) -> str:
        return pace.too_slow(self._watchdog_s, LONGEST_CALL_S)

    def _drive(self, setpoint: Setpoint) -> ReadBack:
        self._pulse.watch()
        self._require_unbroken()  # nothing goes on without the guardian
        read_back = self._driver.drive(setpoint)
        self._ramping = True
        return read_back

    def _read_back(self) -> ReadBack:
        read_back = self._driver.read_back()
        if not self._driver.has_watchdog:  # a poll asks for the same
            self._fed_s = self._monotonic()
        return read_back

    def _off(self, silence: str) -> None:
        self._ramping = False
        self._driver.link.go_on()
        self._driver.off()
        # Off as it should be, but not when it should have been: what was driven must not count.
        if (why := self._pulse.release() or silence) and self._fault is None:
            self._fault = DeviceError(f"{why}; output off, read back")

    def _guarded(self, work: Callable[[], _Result]) -> _Result:
        """Return what `work` gives; a device that fails is turned off, and the fault latches."""
        if self._fault is not None:
            raise self._fault
        try:
            result = work()
            self._require_unbroken()
        except ForeignDevice as error:
            self._fault = error
            raise
        except DeviceError as error:
            self._fault = self._made_safe(error)
            raise self._fault from error
        except BadInput:
            raise  # refused before anything was sent
        except Exception as error:
            self._fault = self._made_safe(DeviceError(f"{type(error).__name__}: {error}"))
            raise self._fault from error
        return result

    def _stop_if_asked(self) -> None:
        if self._stopping:
            self._fault = self._made_safe(EmergencyStop("stopped by hand"))

    def _made_safe(self, error: DeviceError) -> DeviceError:
        """Send off once without waiting; return `error` with what is known of the output."""
        self._stopping, self._ramping, self._armed = False, False, False
        self._recording = None
        if self._gauge is not None:
            self._gauge.abandon()
        self._driver.link.go_on()
        if self._driver.foreign is not None:
            return self._driver.foreign
        with contextlib.suppress(DeviceError):  # what it does not take it does not confirm either
            self._driver.send_off()
        self._driver.driven = None
        try:
            self._driver.confirm_off()
        except OutputUnknown as unknown:
            return error if isinstance(error, OutputUnknown) else type(unknown)(str(error))
        why = self._pulse.release()
        # That it is off is found first; why it is says more, but for a board, which says so itself.
        if why and type(error) is DeviceError and not self._driver.has_watchdog:
            error = DeviceError(why) if why not in str(error) else error
        if isinstance(error, OutputUnknown):
            return error  # it was asked before, and did not say so then
        return type(error)(f"{error}; output off, read back")


def _raised(error: DeviceError) -> NoReturn:
    raise error


def open_rig(
    url: str,
    limits: Limits,
    dialect: str = "board",
    calibration: Resonance | None = None,
    gauge: GaugeOwner | None = None,
) -> Rig:
    """Return the rig at `url`, not armed yet; `gauge` records its forces instead of the device.

    Raise `AddressError` for no such address or dialect, `DeviceError` if it cannot be opened.
    """
    try:
        driver = driver_of(dialect)
        port = open_port(url)
        # It begins with a line end: the program may have died in the middle of a command.
        off = encoded("") + encoded(driver.off_command)
        unwatched = not driver.has_watchdog
        guardian = guardian_of(port.shared, off, limits.watchdog_s) if unwatched else None
        rig = Rig(driver(Link(port), limits), limits, calibration, gauge=gauge, guardian=guardian)
    except BaseException:
        if gauge is not None:
            gauge.close()
        raise
    rig.start()
    return rig
