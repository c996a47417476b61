"""The simulated gauge's end of its wire, beside the device's own."""

from device.errors import DeviceError
from device.link.codec import LineBuffer, text
from device.simulator.device import SimulatedDevice
from device.simulator.transports import Line


class GaugeLine:
    """A gauge on a line: lines in, answers out, as far as the faults let them."""

    def __init__(self, device: SimulatedDevice, line: Line) -> None:
        self._device = device
        self._active = device.broken.active
        self.line = line
        self._buffer = LineBuffer()
        self.there = True
        self._gone = False

    @property
    def listens(self) -> bool:
        """Whether what becomes readable is somebody: a host that hung up is nobody."""
        return self.there and not self._gone

    def serve(self) -> None:
        """Answer what came."""
        if not self.there:
            return
        received = self.line.receive()
        self._gone = received is None
        if received is None:
            self._buffer.clear()
        try:
            lines = self._buffer.feed(received) if received else []
        except DeviceError:
            lines = []
        for line in lines:
            self._answer(line)

    def vanish_or_come_back(self) -> None:
        """Follow the fault `gauge-vanish`."""
        there = "gauge-vanish" not in self._active
        if there and not self.there:
            self.line.come_back()
        elif self.there and not there:
            self.line.hang_up()
        self.there = there

    def _answer(self, line: bytes) -> None:
        self._device.pass_time()
        try:
            answer = self._device.gauge.answer(text(line))
        except DeviceError:
            answer = None
        if answer is None or "gauge-silent" in self._active:
            return
        data = answer.encode("ascii")
        if "gauge-garbled-once" in self._active and line.startswith(b"DATA?"):
            self._active.discard("gauge-garbled-once")
            data = data.replace(b"0", b"1")
        self.line.send(data + b"\n")
