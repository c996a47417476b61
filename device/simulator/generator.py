"""One channel of a laboratory generator: amplitudes as the maker counts them.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide, chapters on
output amplitude, offset, termination and limits.
"""

import math
from dataclasses import dataclass, field

from device.simulator.values import ScpiError

SOURCE_OHM = 50.0
MOST_EMF_VPP = 20.0
OPEN_OHM = math.inf
VPP_PER_VRMS = 2 * math.sqrt(2)
UPPER = ScpiError(-222, "Data out of range; value clipped to upper limit")
LOWER = ScpiError(-222, "Data out of range; value clipped to lower limit")
DEFAULT_LIMIT_V = 10.0


@dataclass
class Channel:
    """Amplitude and offset are kept as the source gives them without a load (emf).

    A generator that is told of a 50 Ω load shows half of it; an amplifier's input takes it whole.
    """

    least_emf_vpp: float
    function: str = "SIN"
    frequency_hz: float = 1_000.0
    emf_vpp: float = 0.2
    emf_offset_v: float = 0.0
    unit: str = "VPP"
    load_ohm: float = SOURCE_OHM
    output: bool = False
    limited: bool = False
    limit_high_v: float = DEFAULT_LIMIT_V
    limit_low_v: float = -DEFAULT_LIMIT_V
    settings: dict[str, float | str] = field(default_factory=dict)

    @property
    def shown(self) -> float:
        """What the load gets of the emf, by what the generator believes of the load."""
        if math.isinf(self.load_ohm):
            return 1.0
        return self.load_ohm / (self.load_ohm + SOURCE_OHM)

    @property
    def amplitude(self) -> float:
        """The amplitude in the unit that is set."""
        return self.from_vpp(self.shown * self.emf_vpp)

    @property
    def offset_v(self) -> float:
        """The offset, V."""
        return self.shown * self.emf_offset_v

    def from_vpp(self, vpp: float) -> float:
        """Return a peak-to-peak voltage in the unit that is set."""
        if self.unit == "VRMS":
            return vpp / VPP_PER_VRMS
        if self.unit == "DBM":
            return 10 * math.log10((vpp / VPP_PER_VRMS) ** 2 / self.load_ohm / 1e-3)
        return vpp

    def to_vpp(self, amplitude: float, unit: str) -> float:
        """Return an amplitude in `unit` as a peak-to-peak voltage."""
        if unit == "VRMS":
            return amplitude * VPP_PER_VRMS
        if unit == "DBM":
            return VPP_PER_VRMS * math.sqrt(10 ** (amplitude / 10) * 1e-3 * self.load_ohm)
        return amplitude

    def most_vpp(self) -> float:
        """Return the largest amplitude that offset and limits leave room for, Vpp."""
        room_v = self.shown * MOST_EMF_VPP / 2 - abs(self.offset_v)
        if self.limited:
            room_v = min(
                room_v, self.limit_high_v - self.offset_v, self.offset_v - self.limit_low_v
            )
        return 2 * room_v

    def least_vpp(self) -> float:
        """Return the smallest amplitude, Vpp."""
        return self.shown * self.least_emf_vpp

    def set_vpp(self, vpp: float) -> ScpiError | None:
        """Keep an amplitude; one out of range is clipped, and the maker's complaint returned."""
        least, most = self.least_vpp(), self.most_vpp()
        self.emf_vpp = min(max(vpp, least), most) / self.shown
        if vpp > most * (1 + 1e-9):
            return UPPER
        return LOWER if vpp < least * (1 - 1e-9) else None

    def set_offset(self, offset_v: float) -> ScpiError | None:
        """Keep an offset; one that leaves no room for the amplitude is clipped."""
        most_v = self.shown * (MOST_EMF_VPP - self.emf_vpp) / 2
        self.emf_offset_v = min(max(offset_v, -most_v), most_v) / self.shown
        if abs(offset_v) > most_v * (1 + 1e-9):
            return UPPER if offset_v > 0 else LOWER
        return None

    def set_levels(self, low_v: float, high_v: float) -> None:
        """Set amplitude and offset by the lowest and highest voltage.

        Raises:
            ScpiError: the low level is not below the high one, or neither can be given.
        """
        if low_v >= high_v:
            raise ScpiError(-221, "Settings conflict; low level is greater than high level")
        if max(abs(low_v), abs(high_v)) > self.shown * MOST_EMF_VPP / 2:
            raise ScpiError(-222, "Data out of range")
        self.emf_vpp = (high_v - low_v) / self.shown
        self.emf_offset_v = (high_v + low_v) / 2 / self.shown

    def limit(self, on: bool) -> None:
        """Switch the limits on or off.

        Raises:
            ScpiError: what is set now exceeds them; they stay off.
        """
        peak_v = self.shown * self.emf_vpp / 2
        fits = self.offset_v + peak_v <= self.limit_high_v * (
            1 + 1e-9
        ) and self.offset_v - peak_v >= self.limit_low_v * (1 + 1e-9)
        if on and not fits:
            raise ScpiError(-221, "Settings conflict; signal exceeds the voltage limits")
        self.limited = on
