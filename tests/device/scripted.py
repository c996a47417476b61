"""A port that answers by the book, for what must be exact to the byte."""

from collections.abc import Callable, Mapping
from itertools import count


class ScriptedPort:
    """Answers each line with what `answers` has for it; records what was sent.

    What `on_repeat` has is answered from the second time on.

    It keeps the event enable register that the link synchronises by, unless it is `deaf_to_sync`.
    A question beside that register is answered as the question alone, after the register.
    """

    def __init__(self, answers: Mapping[bytes, bytes], *, deaf_to_sync: bool = False) -> None:
        self.answers = dict(answers)
        self.on_repeat: Mapping[bytes, bytes] = {}
        self.pending = b""
        self.sent: list[bytes] = []
        self._enabled = b"0"
        self._deaf_to_sync = deaf_to_sync

    def receive(self, timeout_s: float) -> bytes:
        data, self.pending = self.pending, b""
        return data

    def send(self, data: bytes) -> None:
        token, beside, question = data.partition(b";*ESE?;:")
        data = question if beside else data
        if data in self.sent and data in self.on_repeat:
            self.answers[data] = self.on_repeat[data]
        self.sent.append(data)
        if beside and self.answers.get(data):
            self.pending += token[5:] + b";"
        if data.startswith(b"*ESE ") and not self._deaf_to_sync:
            self._enabled = data[5:]
        elif data == b"*ESE?\n" and not self._deaf_to_sync:
            self.pending += self._enabled
        self.pending += self.answers.get(data, b"")

    def close(self) -> None: ...


def ticking(step_s: float = 0.01) -> Callable[[], float]:
    """Return a clock that goes on by `step_s` whenever somebody looks."""
    ticks = count()
    return lambda: next(ticks) * step_s
