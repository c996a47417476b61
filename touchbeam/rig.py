"""A rig for a program of one's own: driven within a study's limits, and off on every way out."""

import math
import os
import reprlib
import signal
import threading
import weakref
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from numbers import Real
from pathlib import Path
from typing import Self

from device.drivers.limits import Setpoint
from device.errors import DeviceError, LimitExceeded
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
from runner.clock import Clock
from runner.journal.names import chains_of, parsed_name, session_name
from runner.journal.opening import checked_place, journal_if_used, mounts_of_this_machine
from runner.journal.store import SessionLog
from runner.launch import device_access
from runner.launch.locks import session_lock
from runner.session.session import versions
from runner.session.waiting import TICK_S
from runner.session.watchdog import NOT_TRIPPED
from runner.study.calibration import kept_calibration
from runner.study.check import validated_study
from runner.study.folder import StudyFolder

Folder = str | os.PathLike[str]

_OFF = "output off, read back"


def open_rig(
    study: Folder | None = None,
    device: str = SIMULATED,
    *,
    journal: Folder | None = None,
    real_time: bool = False,
    seed: int = 1,
) -> "OpenRig":
    """Return the rig at the address `device`, armed and with its watchdog tested.

    Nothing beyond the limits of the `study` (a folder; else of the journal's, else the defaults) is
    ever sent. The simulated rig, whose beam follows from `seed`, waits in no time, or in
    `real_time`. What is driven is kept in the study's folder `journal`, as a session of kind
    `script`, which no report counts. SIGTERM and SIGHUP end the program as `sys.exit` does, so that
    the output goes off first.

    Raises:
        ValueError: the study, the place of the journal or the address is wrong.
        RuntimeError: the rig is in use or does not work; the message says what is known of its
            output.
    """
    folders = {"study": study, "journal": journal}
    for name, place in folders.items():
        text = os.fspath(place) if isinstance(place, str | os.PathLike) else place
        _require(
            text is None or (isinstance(text, str) and "\0" not in text), name, "folder", place
        )
    _require(isinstance(device, str), "device", f"text such as {SIMULATED!r}", device)
    _require(type(seed) is int, "seed", "whole number", seed)
    home = journal if study is None else study
    folder = None if home is None else StudyFolder(path=Path(home))
    file = None if folder is None else validated_study(folder.text(), str(folder.study_file))
    settings, channel = (file.rig, file.force_channel) if file else (RigSettings(), ForceChannel())
    calibration = None if folder is None else kept_calibration(folder.path)
    with ExitStack() as stack:
        stack.enter_context(_ended_by_signals())
        stack.enter_context(device_access.rig_locks(device, channel))
        stepped, session = device_access.stepped_rig, partial(device_access.session_rig, device)
        opening = stepped if device == SIMULATED and not real_time else session
        rig = stack.enter_context(opening(settings, seed, calibration, channel))
        # The rig before the journal: if no device answers, no session is opened.
        identity, log = rig.device.arm(), None
        if journal is not None:
            name = "" if file is None else file.study.name
            log = stack.enter_context(_session(Path(journal), name, rig.clock))
        opened = OpenRig(rig, settings, channel.rate_hz, _Entries(log), stack.pop_all())
    try:
        opened._begin(identity, device)
    except BaseException as error:
        opened.__exit__(type(error), error)
        raise
    return opened


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
        entries: "_Entries",
        stack: ExitStack,
    ) -> None:
        self._rig = rig
        self._settings = settings
        self._rate_hz = rate_hz
        self._entries = entries
        self._began_s: float | None = None
        """When the output went on, None while it is off."""
        self._parts = (rig.device, entries, stack)
        # Also at the end of the interpreter, of a rig that is forgotten.
        self._end = weakref.finalize(self, _abandoned, os.getpid(), *self._parts)

    def __enter__(self) -> Self:
        """Return the rig itself, which must be open."""
        self._open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, *_: object
    ) -> None:
        """Turn the output off, read it back and give the rig back; see `close`."""
        if error is not None:
            self._entries.why = str(error) or type(error).__name__
        self.close()
        if error is not None:
            error.add_note(_OFF)

    def close(self) -> None:
        """Turn the output off, read it back and give the rig back; a second time does nothing.

        Raise RuntimeError if the device does not confirm that its output is off.
        """
        if self._end.detach() is not None:
            _close(*self._parts)

    @property
    def hand(self) -> BeamControl | None:
        """The hand on a simulated rig: `touch`, `lift`; None on a real one."""
        return self._rig.control

    @property
    def forces(self) -> Forces | None:
        """The newest forces; None while the output is off, or without `force_channel.rate_hz`."""
        return self._open().forces

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

    def read_back(self) -> ReadBack:
        """Return what the device says of its drive, and of the finger if it has sensors."""
        return self._said(self._open().read_back())

    def _said(self, said: ReadBack) -> ReadBack:
        self._entries.said += [said] * (self._began_s is not None)
        return said

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

    def off(self) -> None:
        """Turn the output off and read it back.

        Raise RuntimeError if the device does not confirm it.
        """
        self._require_open()
        self._turn_off()

    def _turn_off(self) -> None:
        device, ended_s = self._rig.device, self._rig.clock.monotonic_s()
        device.off()
        if self._began_s is None:
            return
        if self._rate_hz is not None:
            samples = vars(device.recorded())
            moved_s = (self._began_s, ended_s)
            self._entries.append(
                events.TouchRecorded.packed(touch=0, moved_s=moved_s, tare_n=None, **samples)
            )
        self._began_s = None
        self._entries.off()

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
        if not self._end.alive:
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


@dataclass
class _Entries:
    """What the journal keeps, if there is one; `said` is what was read since the output went on."""

    log: SessionLog | None
    why: str = "the program is done"
    said: list[ReadBack] = field(default_factory=list)

    def append(self, event: events.Event) -> None:
        if self.log is not None:
            self.log.append(event)

    def off(self) -> None:
        if self.log is not None and self.log.state.name == "driving":
            self.log.append(events.DriveEnded(read_back=tuple(self.said)))
        self.said = []

    def over(self, *, confirmed: bool) -> None:
        self.off()
        self.append(events.DeviceOff(confirmed=confirmed, why=self.why))
        if confirmed:
            self.append(events.SessionCompleted())


def _close(device: Rig, entries: _Entries, stack: ExitStack) -> None:
    with stack:
        try:
            device.off()
        except BaseException:
            with suppress(Exception):  # that the output may be on matters more
                entries.over(confirmed=False)
            raise
        try:
            entries.over(confirmed=True)
        except Exception as error:
            error.add_note(_OFF)
            raise


def _abandoned(process: int, device: Rig, entries: _Entries, stack: ExitStack) -> None:
    """Close a rig that nobody has closed, unless this is a fork of its process."""
    if os.getpid() != process:
        return
    if threading.current_thread() is threading.main_thread():
        entries.why = "the program forgot the rig"
        _close(device, entries, stack)
    else:
        # Garbage is collected in any thread, also in the owner of the port, who cannot wait for
        # itself. The journal belongs to the thread that opened it.
        threading.Thread(target=_close, args=(device, _Entries(None), stack)).start()


@contextmanager
def _session(path: Path, study: str, clock: Clock) -> Iterator[SessionLog]:
    """Open the next session of kind `script` in the journal of the study in `path`."""
    checked_place(path, mounts_of_this_machine())
    with journal_if_used(StudyFolder(path=path).journal) as journal, ExitStack() as stack:
        with journal.alone():
            before = chains_of(journal, events.SCRIPT, rehearsal=False)
            number = 1 + max((parsed_name(chain).number for chain in before), default=0)
            name = session_name(events.SCRIPT, number)
            stack.enter_context(session_lock(name, path))
            log = SessionLog(journal, name, clock)
            log.append(
                events.SessionOpened(
                    participant=events.SCRIPT,
                    session=number,
                    kind=events.SCRIPT,
                    study=study,
                    slot=None,
                    sequence=(),
                    conditions=(),
                    study_sha256=None,
                    study_text=None,
                    trials=(),
                    language=None,
                    consent=None,
                    seed=None,
                    versions=versions(),
                )
            )
        yield log


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Have signals that would kill this program end it; those that it takes itself stay its own."""
    if threading.current_thread() is not threading.main_thread():  # no other may take signals
        yield
        return
    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    numbers = [getattr(signal, name) for name in names]
    taken = [number for number in numbers if signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, _end)
    try:
        yield
    finally:
        with suppress(ValueError):  # closed by another thread
            for number in taken:
                signal.signal(number, signal.SIG_DFL)


def _end(number: int, _: object) -> None:
    raise SystemExit(128 + number)
