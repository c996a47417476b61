"""A simulated force gauge beside the board, on the same beam and finger; it has its own clock."""

import zlib
from operator import mul

from device.errors import DeviceError
from device.force_channel.recording import CHANNELS, FULL_SCALE
from device.link.codec import number, number_text
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.force_sampler import RATE_RANGE_HZ, SCALE, ForceSampler
from device.simulator.hardware.power_stage import Instrument

IDN = "touchbeam,GAUGE,SIM,1.0"
# So that a host that mixes the two clocks is found out.
AHEAD_S = 1000.0
"""How much longer than the board the gauge has been on."""
MOST_SAMPLES = 40
"""Most samples in an answer, so that it is a line of at most 1024 bytes."""


class GaugeModel:
    """Answers a gauge's lines; docs/reference/wire-protocol.md has them all."""

    def __init__(self, instrument: Instrument, beam: SimulatedBeam) -> None:
        self._instrument = instrument
        self.sampler = ForceSampler(beam)
        self.unit = "N"
        self._mark = 0.0
        self._answers = {
            "*IDN?": lambda: IDN,
            "UNIT?": lambda: self.unit,
            "MARK?": lambda: number_text(self._mark),
            "RATE?": lambda: number_text(self.sampler.rate_hz),
            "RANG?": lambda: ",".join(number_text(FULL_SCALE * size) for size in SCALE),
            "STAT?": lambda: str(int(self.sampler.on)),
            "TIME?": lambda: number_text(self._instrument.time_s + AHEAD_S),
        }

    def answer(self, line: str) -> str | None:
        """Return what is answered to `line`; what is not understood has no answer."""
        header, _, argument = line.strip().upper().partition(" ")
        try:
            if header == "DATA?":
                return self._samples(int(number(argument)))
            self._obey(header, argument)
        except DeviceError:
            return None
        return self._answers[header]() if header in self._answers else None

    def _obey(self, header: str, argument: str) -> None:
        if header == "MARK" and 0 <= (mark := number(argument)) <= 255:
            self._mark = mark
        elif header == "RATE" and RATE_RANGE_HZ[0] <= (rate := number(argument)) <= 1000:
            self.sampler.rate_hz = rate
        elif header in {"STAR", "STOP"}:
            self.sampler.switch(header == "STAR", self._instrument)

    def _samples(self, first: int) -> str:
        block = self.sampler.block(first)
        counts = list(block.counts)[: CHANNELS * MOST_SAMPLES]
        rows = zip(*(counts[channel::CHANNELS] for channel in range(CHANNELS)), strict=True)
        samples = ["{:.4f},{:.4f},{:.5f}".format(*map(mul, row, SCALE)) for row in rows]
        time_s = number_text(block.first_s + AHEAD_S)
        body = ";".join((str(block.first), time_s, str(len(samples)), *samples))
        return f"{body};{zlib.crc32(body.encode('ascii')):08X}"
