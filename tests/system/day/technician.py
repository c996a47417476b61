"""What a technician tries in the morning, and asks in the evening."""

import random
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from unittest.mock import patch

import pytest

from device.drivers.driver import NO_TEMPERATURE
from device.drivers.limits import Setpoint
from device.errors import CannotRecord, DeviceError
from device.link.codec import number_text
from device.link.link import Link
from device.rig import Rig
from device.simulator.models.scpi import ScpiError
from protocol.study.touch import Touch
from runner.launch.device_access import probed
from tests.device.in_process_clock import InProcessClock
from tests.system.day.invariants import require
from tests.system.day.lab import MORNING, PORT, Lab
from tests.system.day.watch import LEAK

THERMOMETER = "MEAS:TEMP?"
MOST_BESIDE_V, MOST_BESIDE = 2.0, 0.05
"""What the monitor may show beside the drive, V, and relative to it."""
MOST_DETUNED = 1e-6
"""How far a frequency may be from the one that is driven, relative to it."""
RATE_HZ = 200
FIRMWARES = {"1.1": False, "0.9": False, "beta": False, "1.2": True, "1.10": True, "2.0": True}
"""Versions of a board's firmware, and whether such a board samples forces."""
SCALES = {
    "2.5E-4,2.5E-4,5E-6": True, "2.5E-4,2.5E-4": False, "2.5E-4,0,5E-6": False,
    "-2.5E-4,2.5E-4,5E-6": False, "1,1,1,1": False,
}  # fmt: skip
"""Sizes of one count, and whether a force channel may have them."""
SWITCHED_OFF = "switched-off"
BY_ITSELF = {
    "watchdog-trip": "its watchdog tripped: it says that it heard nothing",
    "over-temperature": "its protection tripped: over-temperature",
    "panel-on": "output is on, and nobody here switched it on",
    SWITCHED_OFF: "turned its output off by itself",
}
"""How an output changes by itself, and what is told of it."""
_IDLE_S = 0.5
_CLEAR_V = 0.4
"""The monitor is less noisy than that."""
_RAMPED_S = 0.5
"""A ramp of the studies to half of their voltage takes less."""


def without_thermometer(lab: Lab) -> None:
    """Let the board have none, as some are built."""
    lab.watch.thermometer = False
    answers = _answering(lab, THERMOMETER, None, ScpiError(-113, "Undefined header"))
    vars(lab.device.inside.dialect)["_answered"] = answers


def _answering(
    lab: Lab, asked: str, answer: str | None, error: ScpiError | None = None
) -> Callable[[str, str], str | None]:
    """Return what answers `answer` to the question `asked`, or leaves an error."""
    dialect = lab.device.inside.dialect
    answered = dialect._answered

    def answers(header: str, argument: str) -> str | None:
        if header != asked:
            return answered(header, argument)
        limited = asked != THERMOMETER or lab.watch.rig.max_temperature_c
        require(4, limited, "nobody limits the temperature it is asked for")
        if error is not None:
            dialect.status.complain(error)
        return answer

    return answers


def tried(lab: Lab, stream: random.Random) -> None:
    """Try what the device must not do, and what must be noticed."""
    of_a_board = _thermometer, _beyond_its_drive, _other_frequency, _beyond_while_off
    for tries in of_a_board if lab.watch.is_board else (_uncalibrated,):
        tries(lab, stream)
        lab.repair()
        lab.watch.touch = None


@contextmanager
def _rig(lab: Lab) -> Iterator[Rig]:
    rig = lab.opened()
    try:
        yield rig
    finally:
        rig.close()


def _noticed(wrong: bool, work: Callable[[], object], what: str) -> None:
    """Require that `work` fails if and only if something is wrong."""
    try:
        work()
    except DeviceError as error:
        require(4, wrong, f"{what} is within its tolerance, but: {error}")
    else:
        require(4, not wrong, f"nobody notices {what}")


def _thermometer(lab: Lab, stream: random.Random) -> None:
    """A board that must be cool says how warm it is, or that nothing keeps it cool."""
    limit_c = lab.watch.rig.max_temperature_c
    with _rig(lab) as rig:
        remarks = rig.arm().remarks
        lacks = limit_c is not None and not lab.watch.thermometer
        require(11, (NO_TEMPERATURE in remarks) == lacks, f"remarks {remarks}")
        if limit_c is None or not lab.watch.thermometer:
            return
        warm, what = stream.choice(
            (
                (None, "that it does not say how warm it is"),
                (f"{limit_c + 0.5:g}", "that it is too warm"),
                (f"{limit_c - 0.5:g}", ""),
            )
        )
        with patch.object(
            lab.device.inside.dialect, "_answered", _answering(lab, THERMOMETER, warm)
        ):
            _noticed(bool(what), rig.arm, what or "a board that is not too warm")
        rig.arm()


def _beyond_its_drive(lab: Lab, stream: random.Random) -> None:
    """What comes out beyond the drive by more than the tolerance is noticed."""
    volts = stream.choice((0.0, lab.watch.rig.max_voltage_v / 2))
    most_v = MOST_BESIDE_V + MOST_BESIDE * volts
    wrong = stream.random() < 0.5
    beyond_v = most_v + (_CLEAR_V if wrong else -_CLEAR_V)
    instrument = lab.device.inside.instrument
    with _rig(lab) as rig:
        _driven(lab, rig, volts)
        if stream.random() < 0.5:
            instrument.left_v = beyond_v
        else:
            instrument.voltage_v, instrument.ramp_v_per_s = volts + beyond_v, 0.0
        lab.watch.fault(LEAK)
        _noticed(wrong, rig.read_back, f"{beyond_v:g} V beyond {volts:g} V")
        instrument.left_v = instrument.voltage_v = 0.0
        rig.off()


def _beyond_while_off(lab: Lab, stream: random.Random) -> None:
    """What comes out while nothing is driven is noticed, too."""
    wrong = stream.random() < 0.5
    beyond_v = MOST_BESIDE_V + (_CLEAR_V if wrong else -_CLEAR_V)
    instrument = lab.device.inside.instrument

    def idles() -> None:
        InProcessClock(MORNING, lab.device, rig).sleep(_IDLE_S)
        rig.beat()

    with _rig(lab) as rig:
        rig.arm()
        lab.watch.fault(LEAK)
        if stream.random() < 0.5:
            instrument.left_v = beyond_v
        else:
            instrument.voltage_v = beyond_v
        _noticed(wrong, idles, f"{beyond_v:g} V while it is off")
        instrument.left_v = instrument.voltage_v = 0.0
        rig.off()


def _other_frequency(lab: Lab, stream: random.Random) -> None:
    """A frequency that drifts by more than the device's resolution is noticed."""
    wrong = stream.random() < 0.5
    share = stream.choice((-1.0, 1.0)) * MOST_DETUNED * (1.5 if wrong else 0.5)
    with _rig(lab) as rig:
        _driven(lab, rig, 0.0)
        lab.watch.fault(LEAK)
        lab.device.inside.instrument.frequency_hz *= 1 + share
        _noticed(wrong, rig.read_back, f"a frequency that is off by {share:g}")
        rig.off()


def _driven(lab: Lab, rig: Rig, volts: float) -> None:
    """Arm and drive, and wait until the ramp is done."""
    settings = lab.watch.rig
    rig.arm()
    hertz = settings.nominal_resonance_hz
    lab.watch.touch = Touch.model_construct(place="smooth", voltage_v=volts, frequency=1.0)
    lab.watch.resonance_hz = hertz
    rig.drive(Setpoint(voltage_v=volts, frequency_hz=hertz, ramp_v_per_s=settings.ramp_v_per_s))
    InProcessClock(MORNING, lab.device, rig).sleep(_RAMPED_S)


def _uncalibrated(lab: Lab, _stream: random.Random) -> None:
    """A generator, which measures no vibration, needs a calibration."""
    with _rig(lab) as rig:
        rig.arm()
        rig._calibration = None
        with pytest.raises(DeviceError, match="write it to calibration"):
            rig.resonance(lab.watch.rig.nominal_resonance_hz, lab.device.advance)


def tried_in_the_evening(lab: Lab, stream: random.Random) -> None:
    """Try what a board says of itself and of its force channel."""
    switched = stream.choice((_by_itself, _flickers))
    for tries in (switched, _records) if lab.watch.is_board else ():
        lab.repair()
        tries(lab, stream)


def _by_itself(lab: Lab, stream: random.Random) -> None:
    """The operator is told why an output is off, or on, that nobody here has switched."""
    how = stream.choice(list(BY_ITSELF))
    with _rig(lab) as rig:
        if how == SWITCHED_OFF or (how != "panel-on" and stream.random() < 0.5):
            _driven(lab, rig, 0.0)
        else:
            rig.arm()
        if how == SWITCHED_OFF:
            lab.device.inside.instrument.switch(on=False)
        else:
            lab.watch.fault(how)
        rig.beat()
        InProcessClock(MORNING, lab.device, rig).sleep(_IDLE_S)
        with pytest.raises(DeviceError) as told:
            rig.beat()
    require(11, re.search(BY_ITSELF[how], str(told.value)), f"{how}, but told: {told.value}")


def _flickers(lab: Lab, stream: random.Random) -> None:
    """An output that is off in one answer alone is noticed, though the next one says on."""
    dialect, lies = lab.device.inside.dialect, ["0"] * stream.choice((0, 1))
    answered, lied = dialect._answered, bool(lies)

    def answers(header: str, argument: str) -> str | None:
        return lies.pop() if header == "OUTP?" and lies else answered(header, argument)

    with _rig(lab) as rig:
        _driven(lab, rig, 0.0)
        with patch.object(dialect, "_answered", answers):
            _noticed(lied, rig.read_back, "that the output was off for a moment")


def _records(lab: Lab, stream: random.Random) -> None:
    """A board records if its firmware can and its counts have a size."""
    firmware, answer = stream.choice(list(FIRMWARES)), stream.choice(list(SCALES))
    sound = FIRMWARES[firmware] and SCALES[answer]
    refusal = DeviceError if FIRMWARES[firmware] else CannotRecord
    dialect = lab.device.inside.dialect
    with (
        patch.object(dialect, "idn", f"touchbeam,BOARD,SIM,{firmware}"),
        patch.object(dialect, "_answered", _answering(lab, "TRAC:SCAL?", answer)),
        _rig(lab) as rig,
    ):
        rig.arm()
        try:
            rig.record(RATE_HZ)
        except refusal:
            require(13, not sound, f"firmware {firmware} with {answer} does not record")
        else:
            require(13, sound, f"firmware {firmware} records with {answer}")
            InProcessClock(MORNING, lab.device, rig).sleep(_IDLE_S)
            count = len(rig.recorded().counts) // 6  # two bytes of each of three channels
            require(13, count >= _IDLE_S * RATE_HZ, f"only {count} samples are recorded")


def asked(lab: Lab) -> None:
    """Ask a device that is in order what `touchbeam device probe` asks: it says what is true."""
    lab.repair()
    with _rig(lab) as rig:
        rig.arm()
    if not lab.watch.thermometer:
        return  # nor is there an answer to one of the questions
    with patch(
        "runner.launch.device_access.open_link", lambda _: Link(lab.device.port(), lab.device.now_s)
    ):
        said = probed(PORT)
    require(11, said["dialect"] == lab.watch.rig.dialect, f"another dialect: {said}")
    require(11, all(said.values()), f"no answer: {said}")
    silent = {"monitor_v", "force_n", "position_m", "time_s"} - said.keys()
    require(11, not (lab.watch.is_board and silent), f"nothing is said of {silent}")
    for name, truth in _truths(lab).items() if lab.watch.is_board else ():
        require(11, said.get(name) == truth, f"{name} is {truth}, but: {said}")


def _truths(lab: Lab) -> dict[str, str]:
    """Return what a board that is armed and off has to say of itself."""
    stage, settings = lab.device.inside.instrument, lab.watch.rig
    return {
        "output": "0",
        "amplitude_v": number_text(stage.target_v),
        "frequency_hz": number_text(stage.frequency_hz),
        "temperature_c": number_text(stage.temperature_c),
        "protection": "NONE",
        "limit_v": number_text(settings.max_voltage_v),
        "watchdog_s": number_text(settings.watchdog_s),
        "boot": str(stage.boot),
        "errors_queued": "0",
    }
