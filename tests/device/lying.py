"""A simulated device in the test's own process that can be made to lie, one answer at a time."""

from device.drivers.driver import Driver
from device.drivers.registry import driver_of
from device.drivers.setpoints import Limits
from device.link.link import Link
from device.simulator.device import simulated_device
from tests.device.scripted import ticking


class LyingPort:
    """A port with a simulated device behind it; what `lies` has for a query is answered instead.

    A list is used up one answer after the other; its last one stays. Lines in `unknown` are not
    understood, those in `silent` not answered. `sent` are the lines that came. Device time passes
    by `advance` alone.
    """

    def __init__(self, dialect: str = "board") -> None:
        self.device = simulated_device(seed=1, wall_s=lambda: 0.0, dialect=dialect)
        self.lies: dict[str, list[str]] = {}
        self.unknown: set[str] = set()
        self.silent: set[str] = set()
        self.sent: list[str] = []
        self._pending = b""

    def receive(self, timeout_s: float) -> bytes:
        data, self._pending = self._pending, b""
        return data

    def send(self, data: bytes) -> None:
        line = data.decode().strip()
        self.sent.append(line)
        answer = self.device.answer("FROB?" if line in self.unknown else line, wall_s=0.0)
        if answer is not None and line not in self.silent:
            queries = [part.lstrip(":") for part in line.split(";") if "?" in part]
            said = zip(queries, answer.split(";"), strict=True)
            self._pending += ";".join(self._told(*pair) for pair in said).encode() + b"\n"

    def close(self) -> None: ...

    def advance(self, seconds: float) -> None:
        self.device.answer_control(f"advance {seconds}")

    def _told(self, query: str, answer: str) -> str:
        lies = self.lies.get(query, [])
        return answer if not lies else lies.pop(0) if len(lies) > 1 else lies[0]


def unarmed(limits: Limits, dialect: str = "board") -> tuple[Driver, LyingPort]:
    """Return a driver, not armed yet, of a device that lies on demand, and its port."""
    port = LyingPort(dialect)
    clock = ticking(1e-3)
    return driver_of(dialect)(Link(port, monotonic=clock), limits, clock), port


def lying(limits: Limits, dialect: str = "board") -> tuple[Driver, LyingPort]:
    """Return an armed driver of a device that lies on demand, and its port."""
    driver, port = unarmed(limits, dialect)
    driver.arm()
    return driver, port
