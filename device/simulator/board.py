"""The board's dialect: which command reads or sets what. docs/wire-protocol.md says the same."""

from collections.abc import Callable

from device.simulator.beam import SimulatedBeam
from device.simulator.instrument import (
    MAX_FREQUENCY_HZ,
    MAX_RAMP_V_PER_S,
    MAX_VOLTAGE_V,
    WATCHDOG_RANGE_S,
    Instrument,
)
from device.simulator.scpi import Message, ScpiError, boolean, known_header, messages, quantity
from device.wire import number_text

IDN = "touchbeam,BOARD,SIM,1.0"


class BoardDialect:
    """Answers the board's commands out of an instrument and a beam."""

    def __init__(self, instrument: Instrument, beam: SimulatedBeam) -> None:
        self._instrument = instrument
        self._beam = beam
        self._commands: dict[str, Callable[[str], str | None]] = {
            **self._common(),
            **self._drive(),
            **self._safety(),
            **self._measurements(),
        }

    def answer(self, line: str) -> str | None:
        """Return what the board answers to `line`, None if nothing; errors go into its queue."""
        answers = [self._answered(message) for message in messages(line)]
        said = [answer for answer in answers if answer is not None]
        return ";".join(said) if said else None

    def _answered(self, message: Message) -> str | None:
        try:
            pattern = known_header(message.header, self._commands)
            return self._commands[pattern](message.argument)
        except ScpiError as error:
            self._instrument.errors.append(str(error))
            return None

    def _common(self) -> dict[str, Callable[[str], str | None]]:
        return {
            "*IDN?": lambda _: IDN,
            "*OPC?": lambda _: "1",
            "*RST": lambda _: self._instrument.reset(),
            "*CLS": lambda _: self._instrument.errors.clear(),
            "SYSTem:ERRor?": lambda _: self._next_error(),
            "SYSTem:TIME?": lambda _: number_text(self._instrument.time_s),
            "SYSTem:BOOT?": lambda _: str(self._instrument.boot),
        }

    def _drive(self) -> dict[str, Callable[[str], str | None]]:
        return {
            **self._quantity("FREQuency", "frequency_hz", 1e-6, lambda: MAX_FREQUENCY_HZ),
            **self._quantity("VOLTage", "target_v", 0.0, lambda: self._instrument.limit_v),
            **self._quantity("VOLTage:RAMP", "ramp_v_per_s", 1e-3, lambda: MAX_RAMP_V_PER_S),
            "OUTPut": lambda text: self._switch(boolean(text)),
            "OUTPut?": lambda _: str(int(self._instrument.output)),
        }

    def _safety(self) -> dict[str, Callable[[str], str | None]]:
        return {
            **self._quantity("VOLTage:LIMit", "limit_v", 0.0, lambda: MAX_VOLTAGE_V),
            **self._quantity(
                "SYSTem:WATChdog", "watchdog_s", WATCHDOG_RANGE_S[0], lambda: WATCHDOG_RANGE_S[1]
            ),
            "OUTPut:PROTection:TRIPped?": lambda _: str(int(self._instrument.tripped)),
            "OUTPut:PROTection:CLEar": lambda _: self._clear_trip(),
        }

    def _measurements(self) -> dict[str, Callable[[str], str | None]]:
        beam, instrument = self._beam, self._instrument
        return {
            "MEASure:VOLTage?": lambda _: number_text(beam.monitor_v(instrument)),
            "MEASure:FORCe?": lambda _: number_text(beam.measured_force_n(instrument)),
            "MEASure:POSition?": lambda _: number_text(beam.measured_position_m(instrument)),
            "MEASure:VIBRation?": lambda _: number_text(beam.measured_vibration_m(instrument)),
        }

    def _quantity(
        self, header: str, name: str, lowest: float, highest: Callable[[], float]
    ) -> dict[str, Callable[[str], str | None]]:
        def get(argument: str) -> str:
            value = getattr(self._instrument, name) or 0.0
            return number_text(quantity(argument, lowest, highest()) if argument else value)

        def put(argument: str) -> None:
            setattr(self._instrument, name, quantity(argument, lowest, highest()))

        return {f"{header}?": get, header: put}

    def _switch(self, on: bool) -> None:
        if on and self._instrument.tripped:
            raise ScpiError(-221, "Settings conflict; protection tripped")
        if on and self._instrument.watchdog_s is None:
            raise ScpiError(-221, "Settings conflict; no watchdog")
        self._instrument.switch(on)

    def _clear_trip(self) -> None:
        self._instrument.tripped = False

    def _next_error(self) -> str:
        return self._instrument.errors.popleft() if self._instrument.errors else '0,"No error"'
