"""The dialect of the board: which command reads or sets what, as the wire protocol has it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from device.force_channel.recording import encoded
from device.link.codec import block, number_text
from device.simulator.hardware import power_stage
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.force_sampler import RATE_RANGE_HZ, SCALE, ForceSampler
from device.simulator.models import scpi
from device.simulator.models.dialect import Dialect, Happenings, asked
from device.simulator.models.scpi import Call, Handler, ScpiError

SWEEP_TIME_RANGE_S = (1e-3, 500.0)
_V_PER_S = {"": 1.0, "V/S": 1.0}


class BoardDialect(Dialect):
    """Answers the board's commands out of an instrument and a beam."""

    idn = "touchbeam,BOARD,SIM,1.2"
    banner = "touchbeam board 1.2 ready"

    def __init__(self, instrument: power_stage.Instrument, beam: SimulatedBeam) -> None:
        self._instrument = instrument
        self._beam = beam
        self.sampler = ForceSampler(beam)
        self._sweep = power_stage.FrequencySweep()
        """The next one; it begins when it is switched on."""
        super().__init__(self._handlers())

    def passes(self, time_s: float) -> None:
        self.sampler.take_until(time_s, self._instrument)

    def restart(self) -> None:
        self._instrument.restart()
        self._forget()
        self.status.power_on()

    def happenings(self) -> Happenings:
        # A board has no panel: what may change behind the host's back are limit and ramp.
        def forget_limits() -> None:
            self._instrument.limit_v = power_stage.MAX_VOLTAGE_V
            self._instrument.ramp_v_per_s = power_stage.RAMP_RANGE_V_PER_S[1]

        return {"samples-lost": self.sampler.lose, "panel-changed": forget_limits}

    def _handlers(self) -> dict[str, Handler]:
        instrument, sampler, volts = self._instrument, self.sampler, "[SOURce#:]VOLTage"
        frequency, sweep = "[SOURce#:]FREQuency[:CW]", "[SOURce#:]FREQuency:SWEep"
        amplitude = f"{volts}[:LEVel][:IMMediate][:AMPLitude]"
        ramp = (_V_PER_S, *power_stage.RAMP_RANGE_V_PER_S)
        hertz, rates = (scpi.HERTZ, *power_stage.FREQUENCY_RANGE_HZ), (scpi.HERTZ, *RATE_RANGE_HZ)
        limits = (scpi.VOLTS, 0.0, power_stage.MAX_VOLTAGE_V)
        watchdog = (scpi.SECONDS, *power_stage.WATCHDOG_RANGE_S)
        sweep_times = (scpi.SECONDS, *SWEEP_TIME_RANGE_S)
        readings: dict[str, Callable[[power_stage.Instrument], float]] = {
            "VOLTage": self._beam.monitor_v,
            "FORCe": self._beam.measured_force_n,
            "TANGential": self._beam.measured_tangential_n,
            "POSition": self._beam.measured_position_m,
            "VIBRation": self._beam.measured_vibration_m,
            "TEMPerature": lambda instrument: instrument.temperature_c,
        }

        def reading(read: Callable[[power_stage.Instrument], float]) -> Handler:
            return asked(lambda: number_text(read(instrument)))

        return {
            "*IDN?": asked(lambda: self.idn),
            "*OPT?": asked(lambda: "0"),
            "*RST": asked(self._reset),
            "SYSTem:ERRor:COUNt?": asked(lambda: str(len(self.status.errors))),
            "SYSTem:VERSion?": asked(lambda: "1999.0"),
            "SYSTem:TIME?": asked(lambda: number_text(instrument.time_s)),
            "SYSTem:BOOT?": asked(lambda: str(instrument.boot)),
            **self._quantity(frequency, instrument, "frequency_hz", hertz, self._set_frequency),
            amplitude: self._set_voltage,
            f"{amplitude}?": lambda call: number_text(
                scpi.told(call.argument, instrument.target_v, 0.0, instrument.limit_v)
            ),
            f"{volts}:INSTant?": asked(lambda: number_text(instrument.meant_v)),
            **self._quantity(f"{volts}:RAMP", instrument, "ramp_v_per_s", ramp),
            **self._quantity(f"{volts}:LIMit", instrument, "limit_v", limits, self._set_limit),
            "OUTPut#[:STATe]": lambda call: self._switch(scpi.boolean(call.argument)),
            "OUTPut#[:STATe]?": asked(lambda: str(int(instrument.output))),
            "OUTPut#:PROTection:TRIPped?": asked(lambda: str(int(instrument.tripped))),
            "OUTPut#:PROTection:CAUSe?": asked(lambda: instrument.cause),
            "OUTPut#:PROTection:CLEar": asked(self._clear_trip),
            **self._quantity("SYSTem:WATChdog", instrument, "watchdog_s", watchdog),
            **self._quantity(f"{sweep}:STARt", self._sweep, "start_hz", hertz),
            **self._quantity(f"{sweep}:STOP", self._sweep, "stop_hz", hertz),
            **self._quantity(f"{sweep}:TIME", self._sweep, "duration_s", sweep_times),
            f"{sweep}:STATe": lambda call: self._switch_sweep(scpi.boolean(call.argument)),
            f"{sweep}:STATe?": asked(lambda: str(int(instrument.sweep is not None))),
            **{f"MEASure[:SCALar]:{name}?": reading(read) for name, read in readings.items()},
            **self._quantity(
                "TRACe:RATE", sampler, "rate_hz", rates, require=self._require_stopped
            ),
            "TRACe:STATe": lambda call: sampler.switch(scpi.boolean(call.argument), instrument),
            "TRACe:STATe?": asked(lambda: str(int(sampler.on))),
            "TRACe:SCALe?": asked(lambda: ",".join(map(number_text, SCALE))),
            "TRACe:DATA?": self._samples,
        }

    def _require_stopped(self) -> None:
        if self.sampler.on:
            raise ScpiError(-221, "Settings conflict; sampling")

    def _samples(self, call: Call) -> str:
        """The text has a letter for each byte, as the wire sends it."""
        # The number of a sample has 32 bits in a block.
        first = scpi.quantity(call.argument, scpi.NO_UNIT, 0, 2**32 - 1)
        return block(encoded(self.sampler.block(int(first)))).decode("latin-1")

    def _quantity(
        self,
        header: str,
        owner: object,
        name: str,
        rule: tuple[Mapping[str, float], float, float],
        keep: Callable[[float], None] | None = None,
        require: Callable[[], None] = lambda: None,
    ) -> dict[str, Handler]:
        """The two commands of a quantity, which `keep` keeps, if `require` does not object."""
        (units, lowest, highest), kept = rule, keep or partial(setattr, owner, name)

        def put(call: Call) -> None:
            require()
            kept(scpi.quantity(call.argument, units, lowest, highest))

        def get(call: Call) -> str:
            return number_text(
                # A watchdog that was never set is None, and is told as 0.
                scpi.told(call.argument, getattr(owner, name) or 0.0, lowest, highest)
            )

        return {header: put, f"{header}?": get}

    def _set_frequency(self, value: float) -> None:
        self._instrument.sweep = None
        # The gain is that of the fault `read-back-differs`; the read-back must then show it.
        self._instrument.frequency_hz = self._instrument.set_gain * value

    def _set_voltage(self, call: Call) -> None:
        value = scpi.quantity(call.argument, scpi.VOLTS, 0.0, self._instrument.limit_v)
        self._instrument.target_v = self._instrument.set_gain * value

    def _set_limit(self, value: float) -> None:
        # Refused: a limit that lowers the amplitude by itself would hide a slip of the host.
        if value < self._instrument.target_v:
            raise ScpiError(-221, "Settings conflict; the amplitude exceeds this limit")
        self._instrument.limit_v = value

    def _switch(self, on: bool) -> None:
        # The trip comes before the watchdog: it is what must be looked at.
        if on and self._instrument.tripped:
            raise ScpiError(-221, "Settings conflict; protection tripped")
        if on and self._instrument.watchdog_s is None:
            raise ScpiError(-221, "Settings conflict; no watchdog")
        self._instrument.switch(on)

    def _switch_sweep(self, on: bool) -> None:
        now_s = self._instrument.time_s
        self._instrument.sweep = replace(self._sweep, begin_s=now_s) if on else None
        # The frequency is the sweep's from this moment on, also before time passes.
        self._instrument.advance_to(now_s)

    def _clear_trip(self) -> None:
        # Protection stays while its cause does, or clearing it would only delay the damage.
        if self._instrument.hot:
            raise ScpiError(-240, "Hardware error; too hot")
        self._instrument.cause = "NONE"

    def _reset(self) -> None:
        self._instrument.reset()
        self._forget()

    def _forget(self) -> None:
        self.sampler.restart()
        vars(self._sweep).update(vars(power_stage.FrequencySweep()))


MODELS = {"board": BoardDialect}
