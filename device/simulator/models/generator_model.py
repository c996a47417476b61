"""Simulated generators: channels, settings that are kept, an amplifier behind channel 1, a panel.

The amplifier has the gain `AMPLIFIER_GAIN` and an open (high impedance) input. A generator knows
what touchbeam sends, and what drivers of others send to it in the tests.

Source: Agilent 33220A User's Guide and 33500 Series Operating and Service Guide.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from device.drivers.manual import Model, Setting
from device.simulator.hardware.power_stage import Instrument
from device.simulator.models import scpi
from device.simulator.models.dialect import Dialect, Happenings, asked
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
_ROUNDING = 1e-9
"""A value that is at the end of its range but for this share of it is not complained about."""
_AMPLITUDES = {**scpi.VOLTS, "VPP": 1.0, "MVPP": 1e-3, "VRMS": 1.0, "MVRMS": 1e-3}
_OHM = {"": 1.0, "OHM": 1.0, "KOHM": 1e3}
_ROOTS = ("OUTPut", "TRIGger", "SYSTem")
_TRIGGER = "TRIGger#:SOURce"
_APPLY = "[SOURce#:]APPLy"
_UNITS: Mapping[str, Mapping[str, float]] = {"": scpi.NO_UNIT, "s": scpi.SECONDS, "V": scpi.VOLTS}


def _value(setting: Setting, argument: str) -> float | str | bool:
    """Return what a command sets, or raise `ScpiError`."""
    if setting.words:
        return scpi.choice(argument, setting.words)
    if setting.highest == setting.lowest:
        return scpi.boolean(argument)
    return scpi.quantity(argument, _UNITS[setting.unit], setting.lowest, setting.highest)


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
    settings: dict[str, float | str | bool] = field(default_factory=dict)

    @property
    def shown(self) -> float:
        """What the load gets of the emf, by what the generator believes of the load."""
        return 1.0 if math.isinf(self.load_ohm) else self.load_ohm / (self.load_ohm + SOURCE_OHM)

    @property
    def unit_vpp(self) -> float:
        """The unit that is set, Vpp."""
        return VPP_PER_VRMS if self.unit == "VRMS" else 1.0

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

    def set_vpp(self, vpp: float) -> None:
        """Keep an amplitude; one out of range is clipped, and the maker's complaint raised."""
        least, most = self.least_vpp(), self.most_vpp()
        self.emf_vpp = min(max(vpp, least), most) / self.shown
        if vpp > most * (1 + _ROUNDING):
            raise UPPER
        if vpp < least * (1 - _ROUNDING):
            raise LOWER

    def set_offset(self, offset_v: float) -> None:
        """Keep an offset; one that leaves no room for the amplitude is clipped, as `set_vpp`."""
        most_v = self.shown * (MOST_EMF_VPP - self.emf_vpp) / 2
        self.emf_offset_v = min(max(offset_v, -most_v), most_v) / self.shown
        if abs(offset_v) > most_v * (1 + _ROUNDING):
            raise UPPER if offset_v > 0 else LOWER

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
        fits_below = self.level_v(1) <= self.limit_high_v * (1 + _ROUNDING)
        if on and not (fits_below and self.level_v(-1) >= self.limit_low_v * (1 + _ROUNDING)):
            raise ScpiError(-221, "Settings conflict; signal exceeds the voltage limits")
        self.limited = on


class GeneratorDialect(Dialect):
    """Answers a generator's commands; channel 1 is what `instrument` puts on the beam."""

    def __init__(self, model: Model, instrument: Instrument, _beam: object) -> None:
        self.idn, self.plus = model.idn, model.plus
        self._instrument = instrument
        self._model = model
        self._burst_end_s = 0.0
        self.channels: list[Channel] = []
        """The first one drives the beam."""
        self._preset()
        super().__init__(self._handlers(), model.channels)

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
        first, instrument, model = self.channels[0], self._instrument, self._model
        other = self.channels[model.added_channel - 1] if self._has(model.addition) else None
        # The output stage gives no more than this, whatever is added.
        emf_vpp = min(first.emf_vpp + (other.emf_vpp if other else 0.0), MOST_EMF_VPP)
        instrument.target_v = AMPLIFIER_GAIN * emf_vpp / 2 if self._sounding() else 0.0
        deviation_hz = DEVIATION_HZ if self._has(model.modulation) else 0.0
        instrument.frequency_hz = first.frequency_hz + deviation_hz
        if instrument.output:
            instrument.voltage_v = instrument.target_v

    def happenings(self) -> Happenings:
        # Not the first channel itself: a reset makes new ones.
        def change(**values: float | str | bool) -> None:
            vars(self.channels[0]).update(values)

        model = self._model

        def add() -> None:
            settings = self.channels[0].settings
            # A 33220A has no other signal than its modulation.
            settings.update([model.addition if model.addition[0] in settings else model.modulation])

        return {
            "limits-lost": lambda: change(limited=False),
            "panel-changed": lambda: change(
                load_ohm=PANEL_LOAD_OHM, unit=PANEL_UNIT, emf_offset_v=PANEL_OFFSET_V
            ),
            "frequency-changed": lambda: change(frequency_hz=self._instrument.frequency_hz),
            "modulated": lambda: self.channels[0].settings.update([model.modulation]),
            "signal-added": add,
        }

    def of(self, call: Call) -> Channel:
        return self.channels[call.channel - 1]

    def is_on(self, channel: int) -> bool:
        return self._instrument.output if channel == 1 else self.channels[channel - 1].output

    def switch(self, channel: int, *, on: bool) -> None:
        if channel == 1:
            self._instrument.switch(on)
        else:
            self.channels[channel - 1].output = on

    def _has(self, setting: tuple[str, str | bool]) -> bool:
        header, value = setting
        return self.channels[0].settings.get(header) == value

    def _sounding(self) -> bool:
        """Whether channel 1 gives its signal while it is on: a burst may wait, or be over."""
        settings = self.channels[0].settings
        # With an immediate trigger bursts follow one another all the time.
        if not settings.get("BURSt:STATe") or settings[_TRIGGER] == "IMM":
            return True
        # Device time ends a burst, so that a stepped clock does, too.
        return self._instrument.time_s < self._burst_end_s

    def _trigger(self) -> None:
        first = self.channels[0]
        if first.settings[_TRIGGER] != "BUS":
            raise ScpiError(-211, "Trigger ignored")
        cycles = float(first.settings["BURSt:NCYCles"])
        self._burst_end_s = self._instrument.time_s + cycles / first.frequency_hz

    def _preset(self) -> None:
        model = self._model
        kept = {setting.header: setting.default for setting in model.settings if not setting.name}
        self.channels[:] = [
            Channel(least_emf_vpp=model.least_emf_vpp, settings=dict(kept))
            for _ in range(model.channels)
        ]
        self._instrument.reset()
        self._instrument.frequency_hz = self.channels[0].frequency_hz

    def _handlers(self) -> dict[str, Handler]:
        volts, most_hz = "[SOURce#:]VOLTage[:LEVel][:IMMediate]", self._model.most_hz
        commands: dict[str, Handler] = {
            "*IDN?": asked(lambda: self.idn),
            "*RST": asked(self._preset),
            "[SOURce#:]FREQuency[:CW]": self._set_frequency,
            "[SOURce#:]FREQuency[:CW]?": self._tells(lambda it: it.frequency_hz, 1e-6, most_hz),
            "OUTPut#[:STATe]": lambda call: self.switch(
                call.channel, on=scpi.boolean(call.argument)
            ),
            "OUTPut#[:STATe]?": lambda call: self._told(call, self.is_on(call.channel)),
            f"{volts}[:AMPLitude]": self._set_amplitude,
            f"{volts}[:AMPLitude]?": self._amplitude,
            f"{volts}:OFFSet": self._set_offset,
            f"{volts}:OFFSet?": self._tells(lambda it: it.offset_v, -10, 10),
            f"{volts}:HIGH": lambda call: self._set_level(call, high=True),
            f"{volts}:LOW": lambda call: self._set_level(call, high=False),
            f"{volts}:HIGH?": self._tells(lambda it: it.level_v(1), -10, 10),
            f"{volts}:LOW?": self._tells(lambda it: it.level_v(-1), -10, 10),
        }
        for word in self._model.load:
            commands[f"OUTPut#:{word}"] = self._set_load
            commands[f"OUTPut#:{word}?"] = self._tells(lambda it: it.load_ohm, 1.0, 10_000.0)
        if switch := self._model.limit_switch:
            commands[switch] = lambda call: self.of(call).limit(scpi.boolean(call.argument))
            commands[f"{switch}?"] = self._tells(lambda it: it.limited)
        for setting in self._model.settings:
            commands |= self._keeping(setting)
            if setting.header == _TRIGGER:
                commands["*TRG"] = asked(self._trigger)
        if self._model.applies:
            (words,) = (each.words for each in self._model.settings if each.name == "function")
            set_phase = commands["[SOURce#:]PHASe"]
            commands |= {f"{_APPLY}:{word}": self._applied(word, set_phase) for word in words}
            commands[f"{_APPLY}?"] = self._application
        for query, answer in self._model.answers.items():
            commands[query] = asked(partial(str, answer))
        return commands

    def _applied(self, word: str, set_phase: Handler) -> Handler:
        """`APPLy` sets everything at once, and leaves the output as it is."""

        def apply(call: Call) -> None:
            self.of(call).function = scpi.choice(word, (word,))
            values = scpi.split_outside_quotes(call.argument, ",")
            setters = [self._set_frequency, self._set_amplitude, self._set_offset, set_phase]
            # Noise has no frequency, and a constant voltage neither that nor an amplitude.
            if word == "NOISe":
                setters = setters[1:]
            elif word == "DC":
                setters, values = setters[2:], values[2:]
            # Not strict, because the last values may be left out.
            for setter, value in zip(setters, values, strict=False):
                setter(Call(argument=value, channel=call.channel))

        return apply

    def _application(self, call: Call) -> str:
        scpi.nothing(call.argument)
        channel = self.of(call)
        phase, vpp = float(channel.settings["PHASe"]), channel.shown * channel.emf_vpp
        values = (channel.frequency_hz, vpp / channel.unit_vpp, channel.offset_v, phase)
        return f'"{channel.function},{",".join(map(self._text, values))}"'

    def _keeping(self, setting: Setting) -> dict[str, Handler]:
        """The two commands of a setting that is only kept."""
        key = setting.name or setting.header

        def place(call: Call) -> dict[str, float | str | bool]:
            return vars(self.of(call)) if setting.name else self.of(call).settings

        def put(call: Call) -> None:
            place(call)[key] = _value(setting, call.argument)

        def get(call: Call) -> str:
            return self._told(call, place(call)[key], setting.lowest, setting.highest)

        header = setting.header
        header = header if header.startswith(_ROOTS) else f"[SOURce#:]{header}"
        return {header: put, f"{header}?": get}

    def _tells(
        self, value_of: Callable[[Channel], float | bool], lowest: float = 0.0, highest: float = 0.0
    ) -> Handler:
        return lambda call: self._told(call, value_of(self.of(call)), lowest, highest)

    def _told(
        self, call: Call, kept: float | str | bool, lowest: float = 0.0, highest: float = 0.0
    ) -> str:
        """Return the answer to a query: what is kept, or what `MIN` and `MAX` stand for."""
        if isinstance(kept, bool | str):
            scpi.nothing(call.argument)
            return self._model.switches[kept] if isinstance(kept, bool) else kept
        # SCPI has a number for infinity, and no word.
        return self._text(min(scpi.told(call.argument, kept, lowest, highest), SCPI_INFINITY))

    def _text(self, value: float) -> str:
        sign = "+" if self.plus else ""
        return f"{value:{sign}.{self._model.digits}E}"

    def _set_frequency(self, call: Call) -> None:
        value = scpi.quantity(call.argument, scpi.HERTZ, 1e-6, self._model.most_hz)
        self.of(call).frequency_hz = self._gain(call.channel) * value

    def _gain(self, channel: int) -> float:
        """The gain of the fault `read-back-differs`, which only the channel on the beam shows."""
        return self._instrument.set_gain if channel == 1 else 1.0

    def _set_load(self, call: Call) -> None:
        text = scpi.given(call.argument)
        is_open = text in {"INF", "INFINITY", f"{SCPI_INFINITY:.1E}"}
        self.of(call).load_ohm = OPEN_OHM if is_open else scpi.quantity(text, _OHM, 1.0, 10_000.0)

    def _amplitude(self, call: Call) -> str:
        channel = self.of(call)
        values_vpp = channel.shown * channel.emf_vpp, channel.least_vpp(), channel.most_vpp()
        return self._told(call, *(vpp / channel.unit_vpp for vpp in values_vpp))

    def _set_amplitude(self, call: Call) -> None:
        channel, argument = self.of(call), call.argument
        vpp = scpi.extremes(argument, channel.least_vpp(), channel.most_vpp())
        if vpp is None:
            value = scpi.number(argument, _AMPLITUDES)
            # A unit in the command counts before the one that is set, as at the real generator.
            unit = next((unit for unit in ("VPP", "VRMS") if unit in argument.upper()), None)
            in_vrms = (unit or channel.unit) == "VRMS"
            vpp = self._gain(call.channel) * (value * VPP_PER_VRMS if in_vrms else value)
        channel.set_vpp(vpp)

    def _set_offset(self, call: Call) -> None:
        channel = self.of(call)
        room_v = channel.most_vpp() / 2
        extreme = scpi.extremes(call.argument, -room_v, room_v)
        channel.set_offset(scpi.number(call.argument, scpi.VOLTS) if extreme is None else extreme)

    def _set_level(self, call: Call, *, high: bool) -> None:
        channel = self.of(call)
        value = scpi.number(call.argument, scpi.VOLTS)
        channel.set_levels(*((channel.level_v(-1), value) if high else (value, channel.level_v(1))))
