"""Simulated generators: channels, settings that are kept, an amplifier behind channel 1, a panel.

The amplifier has the gain `AMPLIFIER_GAIN` and an open (high impedance) input. A generator knows
what touchbeam sends, and what drivers of others send to it in the tests.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from device.simulator.hardware.power_stage import Instrument
from device.simulator.models import scpi
from device.simulator.models.dialect import Dialect, Status, asked
from device.simulator.models.scpi import Call, Handler, ScpiError

SOURCE_OHM = 50.0
MOST_EMF_VPP = 20.0
OPEN_OHM = math.inf
VPP_PER_VRMS = 2 * math.sqrt(2)
UPPER = ScpiError(-222, "Data out of range; value clipped to upper limit")
LOWER = ScpiError(-222, "Data out of range; value clipped to lower limit")
DEFAULT_LIMIT_V = 10.0
AMPLIFIER_GAIN = 20.0
PANEL_LOAD_OHM, PANEL_UNIT, PANEL_OFFSET_V = 50.0, "VRMS", 1.0
DEVIATION_HZ = 2_000.0
"""How far frequency modulation moves the frequency once it is switched on at the panel."""
SCPI_INFINITY = 9.9e37
_AMPLITUDES = {**scpi.VOLTS, "VPP": 1.0, "MVPP": 1e-3, "VRMS": 1.0, "MVRMS": 1e-3}
_OHM = {"": 1.0, "OHM": 1.0, "KOHM": 1e3}
_ROOTS = ("OUTPut", "TRIGger", "SYSTem")


@dataclass(frozen=True, kw_only=True)
class Model:
    """What differs between the models."""

    idn: str
    channels: int
    digits: int
    least_emf_vpp: float
    most_hz: float
    limits: bool


@dataclass(frozen=True, kw_only=True)
class Kept:
    """What a channel keeps and tells: a number with unit and range, one of `words`, or a switch."""

    header: str
    default: float | str = 0.0
    lowest: float = 0.0
    highest: float = 0.0
    units: Mapping[str, float] = field(default_factory=lambda: scpi.NO_UNIT)
    words: tuple[str, ...] = ()

    @property
    def is_switch(self) -> bool:
        return not self.words and self.highest == self.lowest

    def value(self, argument: str) -> float | str:
        if self.words:
            return scpi.choice(argument, self.words)
        if self.is_switch:
            return float(scpi.boolean(argument))
        return scpi.quantity(argument, self.units, self.lowest, self.highest)


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
    def unit_vpp(self) -> float:
        """The unit that is set, Vpp."""
        return VPP_PER_VRMS if self.unit == "VRMS" else 1.0

    @property
    def amplitude(self) -> float:
        return self.shown * self.emf_vpp / self.unit_vpp

    @property
    def offset_v(self) -> float:
        return self.shown * self.emf_offset_v

    def level_v(self, side: int) -> float:
        """Return the highest (1) or the lowest (-1) voltage."""
        return self.offset_v + side * self.shown * self.emf_vpp / 2

    def most_vpp(self) -> float:
        """Return the largest amplitude that offset and limits leave room for, Vpp."""
        room_v = self.shown * MOST_EMF_VPP / 2 - abs(self.offset_v)
        if self.limited:
            room_v = min(
                room_v, self.limit_high_v - self.offset_v, self.offset_v - self.limit_low_v
            )
        return 2 * room_v

    def least_vpp(self) -> float:
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
        """Set amplitude and offset by both ends; `ScpiError` unless they rise and can be given."""
        if low_v >= high_v:
            raise ScpiError(-221, "Settings conflict; low level is greater than high level")
        if max(abs(low_v), abs(high_v)) > self.shown * MOST_EMF_VPP / 2:
            raise ScpiError(-222, "Data out of range")
        self.emf_vpp = (high_v - low_v) / self.shown
        self.emf_offset_v = (high_v + low_v) / 2 / self.shown

    def limit(self, on: bool) -> None:
        """Switch the limits; `ScpiError`, and they stay off, if what is set now exceeds them."""
        fits_below = self.level_v(1) <= self.limit_high_v * (1 + 1e-9)
        if on and not (fits_below and self.level_v(-1) >= self.limit_low_v * (1 + 1e-9)):
            raise ScpiError(-221, "Settings conflict; signal exceeds the voltage limits")
        self.limited = on


class GeneratorDialect(Dialect):
    """Answers a generator's commands; channel 1 is what `instrument` puts on the beam."""

    functions: ClassVar[tuple[str, ...]] = ()
    limit_header: ClassVar[str] = "[SOURce#:]VOLTage:LIMit"
    limit_state: ClassVar[str] = ":STATe"
    modulation: ClassVar[tuple[str, float | str]]
    """The setting for frequency modulation, and its value while that is on."""
    addition: ClassVar[tuple[str, float | str]]
    """The same for the signal that is added to that of channel 1, and whose signal that is."""
    added_channel: ClassVar[int] = 2

    def __init__(self, instrument: Instrument, model: Model, settings: Sequence[Kept] = ()) -> None:
        self.idn = model.idn
        self._instrument = instrument
        self._model = model
        self._settings = settings
        self.channels: list[Channel] = []
        """The first one drives the beam."""
        self._preset()
        super().__init__(Status(), self._handlers(), model.channels)

    def answer(self, line: str) -> str | None:
        answer = super().answer(line)
        # After each line, because any of them may have changed what is on the beam.
        self.follow()
        return answer

    def restart(self) -> None:
        self._instrument.restart()
        self._preset()
        self.status.power_on()

    def follow(self) -> None:
        """Put on the beam what channel 1 gives: at once, for a generator has no slew."""
        first, instrument = self.channels[0], self._instrument
        # The output stage gives no more than this, whatever is added.
        added = self.channels[self.added_channel - 1].emf_vpp if self._has(self.addition) else 0.0
        emf_vpp = min(first.emf_vpp + added, MOST_EMF_VPP)
        instrument.target_v = AMPLIFIER_GAIN * emf_vpp / 2 if self._sounding() else 0.0
        deviation_hz = DEVIATION_HZ if self._has(self.modulation) else 0.0
        instrument.frequency_hz = first.frequency_hz + deviation_hz
        if instrument.output:
            instrument.voltage_v = instrument.target_v

    def lose_limits(self) -> None:
        self.channels[0].limited = False

    def turn_knobs(self) -> None:
        first = self.channels[0]
        first.load_ohm, first.unit = PANEL_LOAD_OHM, PANEL_UNIT
        first.emf_offset_v = PANEL_OFFSET_V

    def modulate(self) -> None:
        self.channels[0].settings.update([self.modulation])

    def add_signal(self) -> None:
        known = self.addition[0] in self.channels[0].settings
        # A 33220A has no other signal than its modulation.
        self.channels[0].settings.update([self.addition if known else self.modulation])

    def turn_frequency(self, frequency_hz: float) -> None:
        self.channels[0].frequency_hz = frequency_hz

    def of(self, call: Call) -> Channel:
        return self.channels[call.channel - 1]

    def is_on(self, channel: int) -> bool:
        return self._instrument.output if channel == 1 else self.channels[channel - 1].output

    def switch(self, channel: int, *, on: bool) -> None:
        if channel == 1:
            self._instrument.switch(on)
        else:
            self.channels[channel - 1].output = on

    def _has(self, setting: tuple[str, float | str]) -> bool:
        header, value = setting
        return self.channels[0].settings.get(header) == value

    def _sounding(self) -> bool:
        """Whether channel 1 gives its signal while its output is on."""
        return True

    def _preset(self) -> None:
        least_vpp = self._model.least_emf_vpp
        kept = {kept.header: kept.default for kept in self._settings}
        self.channels[:] = [
            Channel(least_emf_vpp=least_vpp, settings=dict(kept))
            for _ in range(self._model.channels)
        ]
        self._instrument.reset()
        self._instrument.frequency_hz = self.channels[0].frequency_hz

    # The commands, as makers' manuals write them, and what each one does.

    def _handlers(self) -> dict[str, Handler]:
        volts, load = "[SOURce#:]VOLTage", self._number(lambda it: it.load_ohm, 1.0, 10_000.0)
        level = f"{volts}[:LEVel][:IMMediate]"
        commands: dict[str, Handler] = {
            "*IDN?": asked(lambda: self.idn),
            "*RST": asked(self._preset),
            "[SOURce#:]FREQuency[:CW]": self._set_frequency,
            "[SOURce#:]FREQuency[:CW]?": self._number(
                lambda it: it.frequency_hz, 1e-6, self._model.most_hz
            ),
            "[SOURce#:]FUNCtion[:SHAPe]": lambda call: setattr(
                self.of(call), "function", scpi.choice(call.argument, self.functions)
            ),
            "[SOURce#:]FUNCtion[:SHAPe]?": self._word(lambda it: it.function),
            "OUTPut#[:STATe]": lambda call: self.switch(
                call.channel, on=scpi.boolean(call.argument)
            ),
            "OUTPut#[:STATe]?": lambda call: self._switch_word(call, on=self.is_on(call.channel)),
            "OUTPut#:LOAD": self._set_load,
            "OUTPut#:LOAD?": load,
            f"{level}[:AMPLitude]": self._set_amplitude,
            f"{level}[:AMPLitude]?": self._amplitude,
            f"{level}:OFFSet": self._set_offset,
            f"{level}:OFFSet?": self._number(lambda it: it.offset_v, -10, 10),
            f"{level}:HIGH": lambda call: self._set_level(call, high=True),
            f"{level}:LOW": lambda call: self._set_level(call, high=False),
            f"{level}:HIGH?": self._number(lambda it: it.level_v(1), -10, 10),
            f"{level}:LOW?": self._number(lambda it: it.level_v(-1), -10, 10),
            f"{volts}:UNIT": lambda call: setattr(
                self.of(call), "unit", scpi.choice(call.argument, ("VPP", "VRMS"))
            ),
            f"{volts}:UNIT?": self._word(lambda it: it.unit),
        }
        if self._model.limits:
            commands |= self._limits()
        for kept in self._settings:
            commands |= self._keeping(kept)
        return commands

    def _limits(self) -> dict[str, Handler]:
        limit, state = self.limit_header, f"{self.limit_header}{self.limit_state}"

        def put(name: str) -> Handler:
            return lambda call: setattr(
                self.of(call), name, scpi.quantity(call.argument, scpi.VOLTS, -10.0, 10.0)
            )

        return {
            f"{limit}:HIGH": put("limit_high_v"),
            f"{limit}:LOW": put("limit_low_v"),
            f"{limit}:HIGH?": self._number(lambda it: it.limit_high_v, -10, 10),
            f"{limit}:LOW?": self._number(lambda it: it.limit_low_v, -10, 10),
            state: lambda call: self.of(call).limit(scpi.boolean(call.argument)),
            f"{state}?": lambda call: self._switch_word(call, on=self.of(call).limited),
        }

    def _keeping(self, kept: Kept) -> dict[str, Handler]:
        """The two commands of a setting that is only kept."""

        def put(call: Call) -> None:
            self.of(call).settings[kept.header] = kept.value(call.argument)

        def get(call: Call) -> str:
            value = self.of(call).settings[kept.header]
            if isinstance(value, str):
                scpi.nothing(call.argument)
                return value
            if kept.is_switch:
                return self._switch_word(call, on=bool(value))
            return self._told(call, value, kept.lowest, kept.highest)

        header = kept.header if kept.header.startswith(_ROOTS) else f"[SOURce#:]{kept.header}"
        return {header: put, f"{header}?": get}

    def _number(
        self, value_of: Callable[[Channel], float], lowest: float, highest: float
    ) -> Handler:
        return lambda call: self._told(call, value_of(self.of(call)), lowest, highest)

    def _word(self, word_of: Callable[[Channel], str]) -> Handler:
        def word(call: Call) -> str:
            scpi.nothing(call.argument)
            return word_of(self.of(call))

        return word

    def _switch_word(self, call: Call, *, on: bool) -> str:
        """Return what a query for a switch answers."""
        scpi.nothing(call.argument)
        return str(int(on))

    def _told(self, call: Call, kept: float, lowest: float, highest: float) -> str:
        """Return the answer to a query: what is kept, or what `MIN` and `MAX` stand for."""
        # SCPI has a number for infinity, and no word.
        return self._text(min(scpi.told(call.argument, kept, lowest, highest), SCPI_INFINITY))

    def _text(self, value: float) -> str:
        return f"{value:+.{self._model.digits}E}"

    def _set_frequency(self, call: Call) -> None:
        value = scpi.quantity(call.argument, scpi.HERTZ, 1e-6, self._model.most_hz)
        self.of(call).frequency_hz = self._gain(call) * value

    def _gain(self, call: Call) -> float:
        """The gain of the fault `read-back-differs`, which only the channel on the beam shows."""
        return self._instrument.set_gain if call.channel == 1 else 1.0

    def _set_load(self, call: Call) -> None:
        text = scpi.given(call.argument)
        is_open = text in {"INF", "INFINITY", f"{SCPI_INFINITY:.1E}"}
        self.of(call).load_ohm = OPEN_OHM if is_open else scpi.quantity(text, _OHM, 1.0, 10_000.0)

    def _amplitude(self, call: Call) -> str:
        channel = self.of(call)
        ends = (channel.least_vpp() / channel.unit_vpp, channel.most_vpp() / channel.unit_vpp)
        return self._told(call, channel.amplitude, *ends)

    def _set_amplitude(self, call: Call) -> None:
        channel, argument = self.of(call), call.argument
        vpp = scpi.extremes(argument, channel.least_vpp(), channel.most_vpp())
        if vpp is None:
            value = scpi.number(argument, _AMPLITUDES)
            # A unit in the command counts before the one that is set, as at the real generator.
            unit = next((unit for unit in ("VPP", "VRMS") if unit in argument.upper()), None)
            in_vrms = (unit or channel.unit) == "VRMS"
            vpp = self._gain(call) * (value * VPP_PER_VRMS if in_vrms else value)
        _complain(channel.set_vpp(vpp))

    def _set_offset(self, call: Call) -> None:
        channel = self.of(call)
        room_v = channel.most_vpp() / 2
        extreme = scpi.extremes(call.argument, -room_v, room_v)
        value = scpi.number(call.argument, scpi.VOLTS) if extreme is None else extreme
        _complain(channel.set_offset(value))

    def _set_level(self, call: Call, *, high: bool) -> None:
        channel = self.of(call)
        value = scpi.number(call.argument, scpi.VOLTS)
        channel.set_levels(*((channel.level_v(-1), value) if high else (value, channel.level_v(1))))


def _complain(complaint: ScpiError | None) -> None:
    """The maker clips, keeps the clipped value, and complains."""
    if complaint is not None:
        raise complaint


def models(
    dialect: Callable[[Instrument, Model], Dialect], generators: Mapping[str, Model]
) -> dict[str, Callable[[Instrument, object], Dialect]]:
    """Return what simulates each of `generators`, by name; none of them needs the beam."""

    def simulating(generator: Model) -> Callable[[Instrument, object], Dialect]:
        return lambda instrument, _: dialect(instrument, generator)

    return {name: simulating(generator) for name, generator in generators.items()}
