"""Frequency, amplitude, offset, limits and output of a generator's channels, in its words.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from device.simulator.hardware.power_stage import Instrument
from device.simulator.models import scpi
from device.simulator.models.keysight_settings import FUNCTIONS
from device.simulator.models.scpi import Call, Handler, ScpiError

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
        # A value that is at the end but for its rounding is not complained about.
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


SCPI_INFINITY = 9.9e37
_AMPLITUDES = {**scpi.VOLTS, "VPP": 1.0, "MVPP": 1e-3, "VRMS": 1.0, "MVRMS": 1e-3, "DBM": 1.0}
_OHM = {"": 1.0, "OHM": 1.0, "KOHM": 1e3}


@dataclass(frozen=True, kw_only=True)
class Model:
    """What differs between the models."""

    idn: str
    channels: int
    digits: int
    least_emf_vpp: float
    most_hz: float
    limits: bool
    most_cycles: int


class Channels:
    """The channels of a generator; the output of the first is what `instrument` gives."""

    functions: ClassVar[tuple[str, ...]] = FUNCTIONS
    limit_header = "[SOURce#:]VOLTage:LIMit"
    limit_state = ":STATe"

    def __init__(self, instrument: Instrument, model: Model) -> None:
        self._instrument = instrument
        self._model = model
        self.all: list[Channel] = []
        self.preset()

    def preset(self) -> None:
        """Go back to what `*RST` gives."""
        least_vpp = self._model.least_emf_vpp
        self.all[:] = [Channel(least_emf_vpp=least_vpp) for _ in range(self._model.channels)]

    def handlers(self) -> dict[str, Handler]:
        """Return what a generator of this model understands of its channels."""
        return {**self._drive(), **self._levels(), **(self._limits() if self._model.limits else {})}

    def of(self, call: Call) -> Channel:
        """Return the channel that a command names."""
        return self.all[call.channel - 1]

    def told(self, call: Call, kept: float, lowest: float, highest: float) -> str:
        """Return the answer to a query: what is kept, or what `MIN` and `MAX` stand for."""
        return self._text(scpi.told(call.argument, kept, lowest, highest))

    def word(self, call: Call, word: str) -> str:
        """Return `word` to a query that takes no argument."""
        scpi.nothing(call.argument)
        return word

    def switch_word(self, call: Call, *, on: bool) -> str:
        """Return what a query for a switch answers."""
        return self.word(call, str(int(on)))

    def _text(self, value: float) -> str:
        return f"{value:+.{self._model.digits}E}"

    def _drive(self) -> dict[str, Handler]:
        return {
            "[SOURce#:]FREQuency[:CW]": self._set_frequency,
            "[SOURce#:]FREQuency[:CW]?": lambda call: self.told(
                call, self.of(call).frequency_hz, 1e-6, self._model.most_hz
            ),
            "[SOURce#:]FUNCtion[:SHAPe]": self._set_function,
            "[SOURce#:]FUNCtion[:SHAPe]?": lambda call: self.word(call, self.of(call).function),
            "OUTPut#[:STATe]": lambda call: self.switch(
                call.channel, on=scpi.boolean(call.argument)
            ),
            "OUTPut#[:STATe]?": lambda call: self.switch_word(call, on=self.is_on(call.channel)),
            "OUTPut#:LOAD": self._set_load,
            "OUTPut#:LOAD?": lambda call: self.told(call, self._load(call), 1.0, 10_000.0),
            **{
                f"[SOURce#:]APPLy:{function}": self._applied(function)
                for function in self.functions
            },
            "[SOURce#:]APPLy?": self._application,
        }

    def _levels(self) -> dict[str, Handler]:
        volts = "[SOURce#:]VOLTage"
        amplitude = f"{volts}[:LEVel][:IMMediate][:AMPLitude]"
        return {
            amplitude: lambda call: self._set_amplitude(call, call.argument),
            f"{amplitude}?": self._amplitude,
            f"{volts}[:LEVel][:IMMediate]:OFFSet": self._set_offset,
            f"{volts}[:LEVel][:IMMediate]:OFFSet?": lambda call: self.told(
                call, self.of(call).offset_v, -10, 10
            ),
            f"{volts}[:LEVel][:IMMediate]:HIGH": lambda call: self._set_level(call, high=True),
            f"{volts}[:LEVel][:IMMediate]:LOW": lambda call: self._set_level(call, high=False),
            f"{volts}[:LEVel][:IMMediate]:HIGH?": lambda call: self._level(call, 1),
            f"{volts}[:LEVel][:IMMediate]:LOW?": lambda call: self._level(call, -1),
            f"{volts}:UNIT": self._set_unit,
            f"{volts}:UNIT?": lambda call: self.word(call, self.of(call).unit),
        }

    def _limits(self) -> dict[str, Handler]:
        limit, state = self.limit_header, f"{self.limit_header}{self.limit_state}"

        def put(name: str) -> Handler:
            return lambda call: setattr(
                self.of(call), name, scpi.quantity(call.argument, scpi.VOLTS, -10.0, 10.0)
            )

        return {
            f"{limit}:HIGH": put("limit_high_v"),
            f"{limit}:LOW": put("limit_low_v"),
            f"{limit}:HIGH?": lambda call: self.told(call, self.of(call).limit_high_v, -10, 10),
            f"{limit}:LOW?": lambda call: self.told(call, self.of(call).limit_low_v, -10, 10),
            state: lambda call: self.of(call).limit(scpi.boolean(call.argument)),
            f"{state}?": lambda call: self.switch_word(call, on=self.of(call).limited),
        }

    def _clipped(self, complaint: ScpiError | None) -> None:
        """The maker clips, keeps the clipped value, and complains."""
        if complaint is not None:
            raise complaint

    def _set_frequency(self, call: Call) -> None:
        value = scpi.quantity(call.argument, scpi.HERTZ, 1e-6, self._model.most_hz)
        # Only channel 1 drives the beam, so that only it shows the fault `read-back-differs`.
        if self.of(call) is self.all[0]:
            value *= self._instrument.set_gain
        self.of(call).frequency_hz = value

    def _set_function(self, call: Call) -> None:
        self.of(call).function = scpi.choice(call.argument, self.functions)

    def is_on(self, channel: int) -> bool:
        """Return whether the output of a channel is on."""
        return self._instrument.output if channel == 1 else self.all[channel - 1].output

    def switch(self, channel: int, *, on: bool) -> None:
        """Switch the output of a channel."""
        if channel == 1:
            self._instrument.switch(on)
        else:
            self.all[channel - 1].output = on

    def _load(self, call: Call) -> float:
        # SCPI has a number for infinity, and no word.
        return min(self.of(call).load_ohm, SCPI_INFINITY)

    def _set_load(self, call: Call) -> None:
        text = scpi.given(call.argument)
        if text in {"INF", "INFINITY"} or text == f"{SCPI_INFINITY:.1E}":
            self.of(call).load_ohm = OPEN_OHM
            # dBm is a power, and an open circuit takes none.
            if self.of(call).unit == "DBM":
                self.of(call).unit = "VPP"
        else:
            extreme = scpi.extremes(text, 1, 1e4)
            value = scpi.number(text, _OHM) if extreme is None else extreme
            if value >= SCPI_INFINITY:
                self.of(call).load_ohm = OPEN_OHM
                return
            self.of(call).load_ohm = scpi.quantity(str(value), scpi.NO_UNIT, 1.0, 10_000.0)

    def _amplitude(self, call: Call) -> str:
        channel = self.of(call)
        least, most = channel.from_vpp(channel.least_vpp()), channel.from_vpp(channel.most_vpp())
        return self.told(call, channel.amplitude, least, most)

    def _set_amplitude(self, call: Call, argument: str) -> None:
        channel = self.of(call)
        gain = self._instrument.set_gain if channel is self.all[0] else 1.0
        extreme = scpi.extremes(argument, channel.least_vpp(), channel.most_vpp())
        if extreme is not None:
            self._clipped(channel.set_vpp(extreme))
            return
        value = scpi.number(argument, _AMPLITUDES)
        # A unit in the command counts before the one that is set, as at the real generator.
        unit = next((unit for unit in ("VPP", "VRMS", "DBM") if unit in argument.upper()), None)
        if (unit or channel.unit) == "DBM" and channel.load_ohm == OPEN_OHM:
            raise ScpiError(-221, "Settings conflict; dBm not possible with infinite load")
        self._clipped(channel.set_vpp(gain * channel.to_vpp(value, unit or channel.unit)))

    def _set_offset(self, call: Call) -> None:
        channel = self.of(call)
        room_v = channel.most_vpp() / 2
        extreme = scpi.extremes(call.argument, -room_v, room_v)
        value = scpi.number(call.argument, scpi.VOLTS) if extreme is None else extreme
        self._clipped(channel.set_offset(value))

    def _level(self, call: Call, side: int) -> str:
        channel = self.of(call)
        return self.told(
            call, channel.offset_v + side * channel.shown * channel.emf_vpp / 2, -10, 10
        )

    def _set_level(self, call: Call, *, high: bool) -> None:
        channel = self.of(call)
        value = scpi.number(call.argument, scpi.VOLTS)
        half_v = channel.shown * channel.emf_vpp / 2
        low_v, high_v = channel.offset_v - half_v, channel.offset_v + half_v
        channel.set_levels(*((low_v, value) if high else (value, high_v)))

    def _set_unit(self, call: Call) -> None:
        unit = scpi.choice(call.argument, ("VPP", "VRMS", "DBM"))
        if unit == "DBM" and self.of(call).load_ohm == OPEN_OHM:
            raise ScpiError(-221, "Settings conflict; dBm not possible with infinite load")
        self.of(call).unit = unit

    def _applied(self, function: str) -> Handler:
        """`APPLy` sets everything at once, and switches the output on."""

        def apply(call: Call) -> None:
            channel = self.of(call)
            values = scpi.split_outside_quotes(call.argument, ",")
            channel.function = scpi.choice(function, FUNCTIONS)
            setters: tuple[Callable[[Call], None], ...] = (
                self._set_frequency,
                lambda part: self._set_amplitude(part, part.argument),
                self._set_offset,
            )
            # Not strict, because the last values may be left out.
            for setter, value in zip(setters, values, strict=False):
                if value.upper() not in {"DEF", "DEFAULT"}:
                    setter(Call(argument=value, channel=call.channel))
            self.switch(call.channel, on=True)

        return apply

    def _application(self, call: Call) -> str:
        scpi.nothing(call.argument)
        channel = self.of(call)
        values = (channel.frequency_hz, channel.amplitude, channel.offset_v)
        return f'"{channel.function} {",".join(self._text(value) for value in values)}"'
