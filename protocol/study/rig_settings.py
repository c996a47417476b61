"""The rig: the device that drives the beam, and the limits that no trial may exceed."""

from typing import Annotated, Literal

from pydantic import Field

from protocol.address import ADDRESS_RULE, is_address
from protocol.study.fields import Line, Positive, Record, Whole, known_as, required, setting

# The name of a driver, of which there may be more than this package knows: the context lists them.
_Spoken = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
Dialect = Annotated[_Spoken, known_as("dialects")]
"""Each is a driver of that name; what is no board is a generator with an amplifier behind it."""

GaugeDialect = Annotated[_Spoken, known_as("gauge dialects")]


Address = Annotated[Line, required(is_address, ADDRESS_RULE)]
_ADDRESSES = (
    "`sim`, a serial port (`/dev/ttyUSB0`, `COM3`), `socket://host:5025` or "
    "`rfc2217://host:5025`, without options"
)


class Rig(Record):
    """The device and the limits that no trial may exceed."""

    device: Address = setting("sim", _ADDRESSES)
    dialect: Dialect = "board"
    """the commands that the device understands: `board`, or those of a generator: `keysight`,
    `rigol`, `siglent`"""
    voltages_are: Literal["peak"] = setting("peak", "every voltage is an amplitude (peak)")
    # From a shaker to what a generator still drives a piezo at.
    nominal_resonance_hz: Positive = setting(24_221.0, ge=20, le=100_000)
    """where the session looks for the rig's own resonance (paper, Table 3)"""
    # A board keeps 200 V itself, and no study file may ask more of any device.
    max_voltage_v: Positive = setting(200.0, "largest amplitude (peak) at the beam", le=200)
    max_frequency_hz: Positive = setting(40_000.0, ge=20, le=100_000)
    """highest frequency of a drive"""
    # At 1 V/s the soft start to 200 V takes more than 3 minutes.
    ramp_v_per_s: Positive = setting(400.0, ge=1, le=2_000)
    """how fast an amplitude may change, soft start included"""
    max_slew_v_per_us: Positive = setting(40.0, le=1_000)
    """largest slew rate that the amplifier can follow: 2 pi f V of the drive"""
    max_drive_s: Positive = setting(30.0, "longest time that one touch is driven", le=600)
    # Piezo amplifiers have gains of 10 to 100; one behind a divider has less than 1.
    amplifier_gain: Positive | None = setting(None, ge=0.1, le=1_000)
    """volts at the beam per volt of the generator; not for a board"""
    # Bench generators give up to 20 V peak-to-peak, some 40 V: more is in mV.
    generator_max_vpp: Positive = setting(10.0, ge=0.1, le=100)
    """largest output of the generator, peak-to-peak, into an open circuit"""
    # A small sheet has some 100 pF, a stack some uF.
    capacitance_nf: Positive | None = setting(None, ge=0.01, le=10_000)
    """capacitance of the piezoelectric sheets, from which the current follows"""
    # 0.1 mA drives no sheet, and 10 A no amplifier for one.
    max_current_ma: Positive | None = setting(None, ge=0.1, le=10_000)
    """largest current that the amplifier supplies: 2 pi f C V of the drive"""
    # An idle stage in a warm room has 30; silicon ends at 150.
    max_temperature_c: Positive | None = setting(None, ge=30, le=150)
    """largest temperature of the power stage, in °C, on a board that measures it; above it the
    output goes off"""
    watchdog_s: Positive = setting(0.5, ge=0.1, le=5)
    """the device turns its output off when the session is silent for this time; less than 0.2 needs
    a computer that does nothing else"""


TARE_S = 0.5
"""How long the forces of an untouched beam are measured before each touch that is recorded."""


class ForceChannel(Record):
    """The fast channel of forces and position, which is recorded during each touch."""

    # What is felt of friction happens within 20 ms; three channels at 1 kHz are half of what a
    # serial line of 115,200 baud carries.
    rate_hz: Whole | None = setting(None, ge=50, le=1_000)
    """samples per second of tangential force, normal force and position; nothing is recorded
    without it"""
    gauge: Address | None = None
    """address of a force gauge on a port of its own, like `rig.device`; without it the board
    measures"""
    gauge_dialect: GaugeDialect = "gauge"
    """the commands that the gauge understands: `gauge`"""

    @property
    def tare_s(self) -> float:
        """How long each touch waits for its tare, s; 0 where nothing is recorded."""
        return 0.0 if self.rate_hz is None else TARE_S
