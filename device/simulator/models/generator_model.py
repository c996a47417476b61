"""Simulated generators: settings that are kept, an amplifier behind channel 1, and a panel.

The amplifier has the gain `AMPLIFIER_GAIN` and an open (high impedance) input.
"""

from collections.abc import Callable, Mapping, Sequence

from device.simulator.hardware.power_stage import Instrument
from device.simulator.models import scpi
from device.simulator.models.dialect import Dialect, Status
from device.simulator.models.generator_channels import MOST_EMF_VPP, Channel, Channels, Model
from device.simulator.models.keysight_settings import Kept
from device.simulator.models.scpi import Call, Handler

AMPLIFIER_GAIN = 20.0
PANEL_LOAD_OHM, PANEL_UNIT, PANEL_OFFSET_V = 50.0, "VRMS", 1.0
DEVIATION_HZ = 2_000.0
"""How far frequency modulation moves the frequency once it is switched on at the panel."""
_UNITS = {"": scpi.NO_UNIT, "S": scpi.SECONDS, "HZ": scpi.HERTZ, "DEG": {"": 1.0, "DEG": 1.0}}
_ROOTS = ("OUTPut", "TRIGger", "SYSTem", "DISPlay", "UNIT", "FORM")


class GeneratorDialect(Dialect):
    """Answers a generator's commands; channel 1 is what `instrument` puts on the beam."""

    def __init__(
        self,
        instrument: Instrument,
        channels: Channels,
        settings: Sequence[Kept],
        handlers: dict[str, Handler],
    ) -> None:
        self._instrument = instrument
        self._channels = channels
        self._settings = settings
        self._preset()
        for kept in settings:
            handlers |= self._kept(kept)
        super().__init__(Status(), handlers, len(channels.all))

    @property
    def channels(self) -> list[Channel]:
        """The channels; the first one drives the beam."""
        return self._channels.all

    def answer(self, line: str) -> str | None:
        """Return what is answered to `line`; the beam follows."""
        answer = super().answer(line)
        # After each line, because any of them may have changed what is on the beam.
        self.follow()
        return answer

    def restart(self) -> None:
        """Lose power and come back."""
        self._instrument.restart()
        self._preset()
        self.status.power_on()

    def follow(self) -> None:
        """Put on the beam what channel 1 gives: at once, for a generator has no slew."""
        first, instrument = self._channels.all[0], self._instrument
        # The output stage gives no more than this, whatever is added.
        emf_vpp = min(first.emf_vpp + self._added_emf_vpp(), MOST_EMF_VPP)
        instrument.target_v = AMPLIFIER_GAIN * emf_vpp / 2 if self._sounding() else 0.0
        if instrument.sweep is None:
            moved_hz = DEVIATION_HZ if self._deviates() else 0.0
            instrument.frequency_hz = first.frequency_hz + moved_hz
        if instrument.output:
            instrument.voltage_v = instrument.target_v

    def lose_limits(self) -> None:
        """Let the voltage limits go."""
        self.channels[0].limited = False

    def turn_knobs(self) -> None:
        """Change load, unit and offset at the panel."""
        first = self.channels[0]
        first.load_ohm, first.unit = PANEL_LOAD_OHM, PANEL_UNIT
        first.emf_offset_v = PANEL_OFFSET_V

    def turn_frequency(self, frequency_hz: float) -> None:
        """Change the frequency at the panel."""
        self.channels[0].frequency_hz = frequency_hz

    def _added_emf_vpp(self) -> float:
        """What a second signal adds to the amplitude of channel 1."""
        return 0.0

    def _deviates(self) -> bool:
        """Whether frequency modulation is on."""
        return False

    def _sounding(self) -> bool:
        """Whether channel 1 gives its signal while its output is on."""
        return True

    def _preset(self) -> None:
        self._channels.preset()
        for channel in self.channels:
            channel.settings |= {kept.header: kept.default for kept in self._settings}
        self._instrument.reset()
        self._instrument.frequency_hz = self.channels[0].frequency_hz

    def _kept(self, kept: Kept) -> dict[str, Handler]:
        """The two commands of a setting that is only kept."""

        def place(call: Call) -> dict[str, float | str]:
            return (self._channels.of(call) if kept.per_channel else self.channels[0]).settings

        def put(call: Call) -> None:
            place(call)[kept.header] = _value(kept, call.argument)

        def get(call: Call) -> str:
            value = place(call)[kept.header]
            if isinstance(value, str):
                return self._channels.word(call, value)
            if kept.is_switch:
                return self._channels.switch_word(call, on=bool(value))
            return self._channels.told(call, value, kept.lowest, kept.highest)

        header = kept.header if kept.header.startswith(_ROOTS) else f"[SOURce#:]{kept.header}"
        return {header: put, f"{header}?": get}


def _value(kept: Kept, argument: str) -> float | str:
    if kept.text:
        return scpi.given(argument)
    if kept.words:
        return scpi.choice(argument, kept.words)
    if kept.is_switch:
        return float(scpi.boolean(argument))
    return scpi.quantity(argument, _UNITS[kept.unit], kept.lowest, kept.highest)


def models(
    dialect: Callable[[Instrument, Model], Dialect], generators: Mapping[str, Model]
) -> dict[str, Callable[[Instrument, object], Dialect]]:
    """Return what simulates each of `generators`, by name; none of them needs the beam."""

    def simulating(generator: Model) -> Callable[[Instrument, object], Dialect]:
        return lambda instrument, _: dialect(instrument, generator)

    return {name: simulating(generator) for name, generator in generators.items()}
