"""The device's end of the wire: lines in, answers out, and what faults do to both."""

import re
from collections import deque
from collections.abc import Callable
from itertools import cycle

from device.simulator.transports import Line

LATE_S = 0.6
DRIP_S = 0.05
FLOOD = b"unasked 1.0\n" * 40
_STAND_INS = {
    "reply-nan": "NAN",
    "reply-inf": "INF",
    "reply-overflow": "9.91E+37",
    "reply-underscore": "1_000",
    "reply-empty": "",
}
_VALUES = re.compile(r"FREQ|VOLT|MEAS", re.IGNORECASE)
_NUMERIC = re.compile(r"[+-]?\d+(\.\d*)?(E[+-]?\d+)?")
_LINE_ENDS = {"line-end-cr": b"\r", "line-end-crlf": b"\r\n"}


class Wire:
    """Sends answers when they are due; `active` are the faults that are on."""

    def __init__(self, line: Line, active: set[str], wall_s: Callable[[], float]) -> None:
        self._line = line
        self._active = active
        self._wall_s = wall_s
        self._due: deque[tuple[float, bytes]] = deque()
        self._first_block = b""
        self._mixed = cycle((b"\n", b"\r\n", b"\r"))

    def heard(self, data: bytes) -> bytes:
        """Return what gets through of what came."""
        if "dead-peer" in self._active:
            return b""
        if "echo" in self._active and data:
            self._line.send(data)
        return data

    def announce(self, banner: str) -> None:
        """Send a line that nobody asked for."""
        self._send(banner.encode("ascii") + b"\n")

    def reply(self, query: str, answer: str) -> None:
        """Send `answer`, a letter for each byte, as far as the faults let it."""
        is_block = answer.startswith("#")
        if not (self._active or is_block):
            self._send(answer.encode("latin-1") + b"\n")
            return
        opc = "opc-silent" in self._active and "*OPC?" in query.upper()
        if opc or self._active & {"silent", "dead-peer"}:
            return
        data = self._stood_in(query, answer).encode("latin-1")
        if self._taken("garbled") or (is_block and self._taken("block-garbled")):
            data = bytes(byte ^ 0x80 if place % 3 == 0 else byte for place, byte in enumerate(data))
        if "truncated-reply" in self._active or (is_block and self._taken("block-truncated")):
            data = data[: len(data) // 2]
        else:
            data += self._line_end()
        if is_block:
            data = self._of_blocks(data)
        self._send(data)

    def _of_blocks(self, data: bytes) -> bytes:
        """Return what is sent of a block of samples."""
        self._first_block = self._first_block or data
        if "block-stale" in self._active:
            return self._first_block
        if self._taken("block-lost"):
            return b""
        return 2 * data if self._taken("block-doubled") else data

    def wait(self) -> None:
        """Send what is due by now."""
        if "flood" in self._active:
            self._line.send(FLOOD)
        while self._due and self._due[0][0] <= self._wall_s():
            self._line.send(self._due.popleft()[1])

    def idle_s(self, longest_s: float) -> float:
        """Return how long nothing is due, `longest_s` at most."""
        if "flood" in self._active:
            return 0.001
        if not self._due:
            return longest_s
        return min(max(self._due[0][0] - self._wall_s(), 0.0), longest_s)

    def _send(self, data: bytes) -> None:
        """Answers keep their order, however late one of them is."""
        late_s = LATE_S if self._active and self._taken("late-reply") else 0.0
        drip = "slow-drip" in self._active
        if not (late_s or drip or self._due):
            self._line.send(data)
            return
        start_s = max(self._wall_s() + late_s, self._due[-1][0] if self._due else 0.0)
        pieces = [bytes([byte]) for byte in data] if drip else [data]
        self._due += [(start_s + DRIP_S * number, piece) for number, piece in enumerate(pieces)]

    def _stood_in(self, query: str, answer: str) -> str:
        for name, text in _STAND_INS.items():
            if name in self._active and _VALUES.search(query):
                fields = answer.split(";")
                return ";".join(text if _NUMERIC.fullmatch(field) else field for field in fields)
        return answer

    def _line_end(self) -> bytes:
        if "line-end-mixed" in self._active:
            return next(self._mixed)
        ends = (end for name, end in _LINE_ENDS.items() if name in self._active)
        return next(ends, b"\n")

    def _taken(self, name: str) -> bool:
        """Whether a fault is on; one that comes once is used up by being asked for."""
        once = f"{name}-once"
        if once in self._active:
            self._active.discard(once)
            return True
        return name in self._active
