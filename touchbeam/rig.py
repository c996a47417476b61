"""A rig for a program of one's own: driven within a study's limits, and off on every way out."""

import math
import os
import reprlib
import weakref
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial, wraps
from numbers import Real
from pathlib import Path
from typing import Concatenate, ParamSpec, Self, TypeVar

from device.drivers.limits import Setpoint
from device.errors import DeviceError, LimitExceeded, OutputUnknown
from device.force_channel.recording import Forces
from device.rig import Rig
from device.simulator.client import BeamControl
from device.study_limits import device_limits
from protocol.address import SIMULATED
from protocol.errors import BadInput, WorkFailed
from protocol.journal import events
from protocol.journal.records import Identity, ReadBack
from protocol.study.rig_settings import ForceChannel
from protocol.study.rig_settings import Rig as RigSettings
from runner.launch import device_access
from runner.session.waiting import TICK_S
from runner.session.watchdog import NOT_TRIPPED
from runner.study.calibration import kept_calibration
from runner.study.check import runnable_study
from runner.study.folder import StudyFolder
from touchbeam.held_rigs import OFF, HeldRig, ended_by_signals, say
from touchbeam.script_journal import Entries, script_session

Folder = str | os.PathLike[str]
_Asked = ParamSpec("_Asked")
_Given = TypeVar("_Given")


def open_rig(
    study: Folder | None = None,
    device: str | None = None,
    *,
    journal: Folder | None = None,
    real_time: bool = False,
    seed: int = 1,
) -> "OpenRig":
    """Return the rig, armed and with its watchdog tested.

    The `device` is that of the `study` (a folder; else the journal's) unless an address is given;
    without a study, or with the address `sim`, it is simulated. Before a real one is armed, a line
    on standard error says which. Nothing beyond the limits of the study (else the defaults) is ever
    sent. The simulated rig, whose beam follows from `seed`, waits in no time, or in `real_time`.
    What is driven is kept in the study's folder `journal`, as a session of kind `script`, which no
    report counts.

    While a rig is open, SIGINT, SIGTERM, SIGHUP and SIGQUIT turn the output off first, and then end
    the program as KeyboardInterrupt or `sys.exit` does, unless it has handlers of its own. Python
    lets only the main thread take signals. Where only others have opened rigs, these signals end
    the program at once, and the device's watchdog or guardian turns the output off; but SIGINT
    (Ctrl-C) reaches the main thread alone, and the others drive on.

    Raises:
        ValueError: the study, the place of the journal or the address is wrong.
        RuntimeError: the rig is in use or does not work; the message says what is known of its
            output.
    """
    try:
        return _opened(study, device, journal, seed, real_time=real_time)
    except (BadInput, WorkFailed) as error:
        # The message is whole: what led to it would be tracebacks before the program's own.
        raise error from None


def _opened(
    study: Folder | None,
    device: str | None,
    journal: Folder | None,
    seed: int,
    *,
    real_time: bool,
) -> "OpenRig":
    folders = {"study": study, "journal": journal}
    for name, place in folders.items():
        text = os.fspath(place) if isinstance(place, str | os.PathLike) else place
        _require(
            text is None or (isinstance(text, str) and "\0" not in text), name, "folder", place
        )
    right = device is None or isinstance(device, str)
    _require(right, "device", f"text such as {SIMULATED!r}", device)
    _require(type(seed) is int, "seed", "whole number", seed)
    home = journal if study is None else study
    folder = None if home is None else StudyFolder(path=Path(home))
    file = None if folder is None else runnable_study(folder.text(), str(folder.study_file))
    settings, channel = (file.rig, file.force_channel) if file else (RigSettings(), ForceChannel())
    calibration = None if folder is None else kept_calibration(folder.path)
    url = settings.device if device is None else device
    stepped = url == SIMULATED and not real_time
    with ExitStack() as stack:
        stack.enter_context(ended_by_signals())
        stack.enter_context(device_access.rig_locks(url, channel))
        session = partial(device_access.session_rig, url)
        opening = device_access.stepped_rig if stepped else session
        if url != SIMULATED:
            say(f"opening the rig at {url} ({settings.dialect}); nobody may touch the beam yet")
        elif settings.device != SIMULATED:
            say(f"this rig is simulated; the one of the study, at {settings.device}, is not opened")
        place = None if folder is None else folder.path
        rig = stack.enter_context(opening(settings, seed, calibration, channel, place))
        # The rig before the journal: if no device answers, no session is opened.
        identity, log = rig.device.arm(), None
        for remark in identity.remarks:  # that it has no watchdog, for one
            say(remark)
        if journal is not None:
            name = "" if file is None else file.study.name
            log = stack.enter_context(script_session(Path(journal), name, rig.clock))
        entries = Entries(log)
        held = HeldRig(rig.device, entries, stack.pop_all(), stepped=stepped)
    opened = OpenRig(rig, settings, channel.rate_hz, held)
    try:
        opened._begin(identity, url)
    except BaseException as error:
        opened.__exit__(type(error), error)
        raise
    return opened


_Method = Callable[Concatenate["OpenRig", _Asked], _Given]


def _told(method: _Method[_Asked, _Given]) -> _Method[_Asked, _Given]:
    """Raise what the method raises as one error; one of the device need not be told again."""

    @wraps(method)
    def asked(self: "OpenRig", /, *args: _Asked.args, **kwargs: _Asked.kwargs) -> _Given:
        try:
            return method(self, *args, **kwargs)
        except DeviceError as error:
            self._require_open()  # that a signal stopped it, or another thread closed it, says more
            self._is_told = True
            raise error from None
        except (BadInput, WorkFailed) as error:
            raise error from None

    return asked


class OpenRig:
    """An open rig, which `open_rig` returns: leave its `with` block, or `close` it, to turn it off.

    A program that hangs must not leave the output on. While it is on, call one of these methods,
    such as `wait`, more often than every `rig.watchdog_s` of the study (0.5 s); else the device
    turns it off. Each method raises RuntimeError if the device has failed meanwhile.
    """

    def __init__(
        self,
        rig: device_access.SessionRig,
        settings: RigSettings,
        rate_hz: int | None,
        held: HeldRig,
    ) -> None:
        self._rig = rig
        self._settings = settings
        self._rate_hz = rate_hz
        self._held = held
        self._entries = held.entries
        self._began_s: float | None = None
        """When the output went on, None while it is off."""
        self._is_told = False
        """Whether the program knows that the device failed."""
        # The end of the interpreter closes what is held then by itself.
        weakref.finalize(self, held.forgotten).atexit = False

    def __enter__(self) -> Self:
        """Return the rig itself, which must be open."""
        self._open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, *_: object
    ) -> None:
        """Turn the output off, read it back and give the rig back; see `close`."""
        if not self._held.is_ours:
            return
        if error is not None and not self._held.stopped_by:
            self._entries.why = str(error) or type(error).__name__
        try:
            self.close()
        except DeviceError as failed:
            if error is None or isinstance(failed, OutputUnknown):
                raise
            error.add_note(str(failed))
        else:
            if error is not None and OFF not in str(error):
                error.add_note(OFF)

    def close(self) -> None:
        """Turn the output off, read it back and give the rig back; a second time does nothing.

        In a fork of the process that opened the rig it does nothing either. Raise RuntimeError if
        the device does not confirm that its output is off, or had turned it off by itself.
        """
        ended_s = self._rig.clock.monotonic_s()
        self._held.close(then=lambda: self._end_drive(ended_s))

    @property
    def hand(self) -> BeamControl | None:
        """The hand on a simulated rig: `touch`, `lift`; None on a real one."""
        return self._rig.control

    @property
    def forces(self) -> Forces | None:
        """The newest forces; None while the output is off, or without `force_channel.rate_hz`."""
        return self._open().forces

    @_told
    def drive(self, voltage_v: float, frequency_hz: float) -> ReadBack:
        """Switch the output on, or change it; return what the device says.

        The amplitude changes at the study's `rig.ramp_v_per_s`, while the program waits.

        Raises:
            ValueError: voltage, frequency, slew or current exceed the limits; nothing was sent.
        """
        device, settings = self._open(), self._settings
        setpoint = Setpoint(
            voltage_v=_number("voltage_v", voltage_v),
            frequency_hz=_number("frequency_hz", frequency_hz),
            ramp_v_per_s=settings.ramp_v_per_s,
        ).checked(device_limits(settings))
        # On the disk before the output goes on: nothing is driven of which the journal is ignorant.
        self._entries.append(events.DriveStarted(commanded=setpoint))
        if self._began_s is None:
            self._began_s = self._rig.clock.monotonic_s()
            if self._rate_hz is not None:
                device.record(self._rate_hz, self._rig.clock.monotonic_s)
        return self._said(device.drive(setpoint))

    @_told
    def read_back(self) -> ReadBack:
        """Return what the device says of its drive, and of the finger if it has sensors."""
        return self._said(self._open().read_back())

    def _said(self, said: ReadBack) -> ReadBack:
        self._entries.said += [said] * (self._began_s is not None)
        return said

    @_told
    def wait(self, seconds: float = 0.0) -> None:
        """Wait, and keep the watchdog quiet; without `seconds` say only that the program is alive.

        Raises:
            ValueError: the output would be on for longer than the study's `rig.max_drive_s`.
        """
        seconds = _number("seconds", seconds)
        if not 0 <= seconds < math.inf:
            raise LimitExceeded(f"seconds must be at least 0, got {seconds}")
        device, clock = self._open(seconds), self._rig.clock
        end_s = clock.monotonic_s() + seconds
        device.beat()
        while (left_s := end_s - clock.monotonic_s()) > 1e-9:  # rounding of summed ticks
            clock.sleep(min(TICK_S, left_s))
            device.beat()

    @_told
    def off(self) -> None:
        """Turn the output off and read it back.

        Raise RuntimeError if the device does not confirm it, or had turned it off by itself.
        """
        self._require_open()
        self._turn_off()

    def _turn_off(self) -> None:
        ended_s = self._rig.clock.monotonic_s()
        self._rig.device.off()
        self._end_drive(ended_s)

    def _end_drive(self, ended_s: float) -> None:
        """Keep what was recorded; raise DeviceError if the device had turned itself off."""
        device, began_s, self._began_s = self._rig.device, self._began_s, None
        if began_s is None:
            return
        try:
            if self._is_told or self._held.stopped_by:
                return
            if self._rate_hz is not None:
                samples = vars(device.recorded())
                moved_s = (began_s, ended_s)
                self._entries.append(
                    events.TouchRecorded.packed(touch=0, moved_s=moved_s, tare_n=None, **samples)
                )
            device.check()
        finally:
            self._entries.off()

    @_told
    def resonance(self) -> float:
        """Return the beam's resonance, Hz, measured with 10 V at most; the output is off then.

        A rig that cannot measure it has that of the study's calibration.
        """
        self.off()
        device, near_hz = self._open(), self._settings.nominal_resonance_hz
        found = device.resonance(near_hz, self.wait)
        self._entries.append(
            events.ResonanceMeasured(frequency_hz=found.frequency_hz, tip_m_per_v=found.tip_m_per_v)
        )
        return found.frequency_hz

    def _require_open(self) -> None:
        held = self._held
        if not held.is_ours:
            raise WorkFailed("the rig belongs to another process, of which this is a fork")
        if held.stopped_by:
            self.close()
            raise WorkFailed(f"{held.stopped_by}, and closed; touchbeam.open_rig opens it anew")
        if not held.is_open:
            raise WorkFailed("the rig is closed; touchbeam.open_rig opens it anew")

    def _open(self, seconds: float = 0.0) -> Rig:
        self._require_open()
        if self._began_s is not None:
            lasts_s = self._rig.clock.monotonic_s() + seconds - self._began_s
            most_s = self._settings.max_drive_s
            if lasts_s > most_s:
                # Off also where the program goes on all the same.
                self._turn_off()
                raise LimitExceeded(
                    f"a drive must not last longer than rig.max_drive_s = {most_s:g} s, got "
                    f"{lasts_s:.3g} s; the output is off now: turn it off in between"
                )
        return self._rig.device

    def _begin(self, identity: Identity, address: str) -> None:
        """Test the watchdog, if there is one, before anything is driven."""
        self._entries.append(events.DeviceArmed(**vars(identity)))
        if self._rig.device.has_watchdog:
            tripped = self._rig.device.watchdog_trips()
            tested = events.WatchdogTested(tripped=tripped, idn=identity.idn, address=address)
            self._entries.append(tested)
            if not tripped:
                raise DeviceError(NOT_TRIPPED)


def _require(right: bool, name: str, what: str, value: object) -> None:
    if not right:
        raise BadInput(f"{name} must be a {what}, got {reprlib.repr(value)}")


def _number(name: str, value: object) -> float:
    # Neither a truth nor a text such as "100": a program that mixes them up must not drive.
    number = math.nan
    if right := type(value) is not bool and isinstance(value, Real):
        try:
            number = float(value)
        except OverflowError:  # a whole number of hundreds of digits
            right = False
    _require(right, name, "number", value)
    return number
