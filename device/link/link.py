"""The link to a device: one command at a time, and every answer matched to its query in time.

An answer that missed its deadline may still arrive. The link is then out of step and accepts no
answer until the device has shown that no earlier one is outstanding.

Deadlines are those of a device that answers at once. How long one takes for a line is measured, and
`keep_pace` adds that to every deadline.
"""

import re
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle
from statistics import median
from typing import TypeVar

from device.errors import DeviceError, EmergencyStop, LinkTimeout, ProtocolError
from device.link.codec import BlockBuffer, LineBuffer, encoded, fields, text
from device.link.port import PORT_ERRORS, WRITE_TIMEOUT_S, Port, open_port

ANSWER_TIMEOUT_S = 0.4
SYNC_TIMEOUT_S = 1.0
STOOD_STILL_S = WRITE_TIMEOUT_S + 1.0
HANDSHAKE_S = 5.0
"""Time in which a device answers for the first time: a board restarts when its port is opened, and
some generators take 3 s."""
_HANDSHAKE_TRY_S = 0.5
_QUIET_S = 0.03
_CUT_SHORT_S = 0.1
"""A block of which nothing more came for that long is cut short."""
_LINES_AHEAD = 6
"""Most lines that a device has before the one whose answer is awaited: off, and two numbers."""
_MEASURED = 64
"""How many of the last answers tell how long the device takes."""
_SLICE_S = 0.02
"""Interval at which a waiting link checks whether it was stopped."""
MOST_LINES = 200
"""Most unsolicited lines that are discarded before the device counts as sending without end."""
_IDENTITY = re.compile(r"[^,]+,[^,]+,[^,]*,.*")
_PROMPT = re.compile(rb"[^,]{0,40}>\s*")
"""What a port for people writes before it takes a line: `>>`, or `33522B> `."""
_FOR_PEOPLE = (
    "; a telnet port (5024) does that: use the one for programs, such as socket://HOST:5025 (5555 "
    "at Rigol)"
)

_Value = TypeVar("_Value")


@dataclass(frozen=True, kw_only=True)
class Register:
    """A number that the device stores and returns, and that touchbeam may choose.

    `put` stores a number from 1 to 255 and `get` returns it, in the group of `told`. The device may
    answer several queries in one line (`compound`). A register that users set, too,
    (`is_a_setting`) may change only once the rig is armed.
    """

    put: str
    get: str
    told: "re.Pattern[str]"
    compound: bool = False
    is_a_setting: bool = False

    def is_told(self, line: str, token: int) -> bool:
        """Return whether `line` is the answer that contains `token`."""
        answer = self.told.fullmatch(line)
        return answer is not None and int(answer[1]) == token


EVENT_ENABLE = Register(put="*ESE {}", get="*ESE?", told=re.compile(r"\+?(\d{1,3})"), compound=True)
"""The event enable register, which every IEEE 488.2 device has and touchbeam does not use."""


class Link:
    """Commands and queries over one port, where each answer belongs to the query before it."""

    def __init__(self, port: Port, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._port = port
        self._monotonic = monotonic
        self._buffer = LineBuffer()
        self._lines: list[bytes] = []
        self._in_step = True
        self._stopped = False
        # From 1 on, because 0 is what the register holds after power-on.
        self._tokens = cycle(range(1, 256))
        self.register = EVENT_ENABLE
        self.alive: Callable[[], None] = lambda: None
        """Called many times a second while the link waits, and before each write."""
        self._pace_s = 0.0
        self._unanswered = 0
        self._asked_s = 0.0
        self._took_s: deque[float] = deque(maxlen=_MEASURED)

    @property
    def answer_s(self) -> float:
        """How long the device takes for a line, by its last answers; 0 before the first."""
        return median(self._took_s) if self._took_s else 0.0

    @property
    def timeout_s(self) -> float:
        """How long an answer may take."""
        return ANSWER_TIMEOUT_S + _LINES_AHEAD * self._pace_s

    def keep_pace(self) -> None:
        """Leave time in every later deadline for lines that take as long as they do now."""
        # Not with each answer: a device that becomes slower while it is driven must be noticed.
        self._pace_s = self.answer_s

    def tell(self, command: str) -> None:
        """Send `command` as one line in one write; raise `DeviceError` if the port refuses it."""
        begin_s = self._monotonic()
        self.alive()
        if not self._unanswered:
            self._asked_s = begin_s
        self._unanswered += 1
        try:
            self._port.send(encoded(command))
        except PORT_ERRORS as error:
            # Whatever was on its way to a port that failed may still arrive.
            self._in_step = False
            why, took_s = str(error), self._monotonic() - begin_s
            if took_s > STOOD_STILL_S:
                # The port's own timeout ends a write much earlier, unless nothing ran meanwhile.
                why = (
                    f"nothing moved for {took_s:.1f} s, where the port gives up after "
                    f"{WRITE_TIMEOUT_S:g} s (the program may have hung, or the computer slept)"
                )
            raise DeviceError(f"cannot send {command!r} to the device: {why}") from error

    def ask(self, query: str) -> str:
        """Send `query` and return the line that answers it.

        Raise `LinkTimeout` without a whole line in `timeout_s`, `ProtocolError` for one that is cut
        short or no text, and `DeviceError` if the port is gone.
        """
        self._get_into_step()
        self.tell(query)
        # Until the answer is there: an exception on the way leaves the link out of step.
        self._in_step = False
        answer = text(self._line(query, self._deadline_s()))
        self._in_step = True
        return answer

    def query(self, query: str, parsed: Callable[[str], _Value]) -> _Value:
        """Return the parsed answer to `query`, which is repeated once if the answer is garbled.

        Raise `DeviceError` as `ask` and `parsed`, or if a second line came with the answer.
        """
        # Repeated once and only for garbled bytes: a query changes nothing, so this is safe.
        return self._twice(lambda: parsed(self._only_answer(query)))

    def block(self, query: str, parsed: Callable[[bytes], _Value]) -> _Value:
        """Return the parsed content of the block that answers `query`; repeat it as `query` does.

        The device must answer the same query with the same block: a garbled one is then not lost.
        Both together have `timeout_s`, so that broken blocks hide no other fault for longer.
        """
        deadline_s = self._deadline_s()
        return self._twice(lambda: parsed(self._only_block(query, deadline_s)))

    def certain(self, queries: Sequence[str], parsed: Callable[[list[str]], _Value]) -> _Value:
        """Return the parsed answers to `queries`; no unsolicited line can be taken for one.

        The answers must come with a number that touchbeam chose: in the same line, or between two
        such numbers. Raises as `query`.
        """
        asked = self._beside_token if self.register.compound else self._between_tokens
        return self._twice(lambda: parsed(asked(queries)))

    def identify(self, patience_s: float = HANDSHAKE_S) -> str:
        """Return the answer to `*IDN?`, ignoring messages at start-up, within `patience_s`.

        Raise `ProtocolError` for a port for people, and `LinkTimeout` without four fields.
        """
        deadline_s = self._monotonic() + patience_s
        _require_none_for_people(self._quiet(deadline_s), ended=False)
        heard, repeats = b"", 0
        # Asked again and again: a board that restarts as its port is opened loses questions.
        while self._monotonic() < deadline_s:
            self.tell("*IDN?")
            try_s = min(self._monotonic() + _HANDSHAKE_TRY_S, deadline_s)
            while (line := self._next_line(try_s)) is not None:
                # An echo would be taken for the answer to every later query.
                _require_none_for_people(line)
                # A banner at start-up has not four fields.
                if line.isascii() and _IDENTITY.fullmatch(line.decode()):
                    self._skip_answers(repeats)
                    return text(line)
                heard = line
            repeats += 1
        last = f"; its last message was {heard[:60]!r}" if heard else ""
        raise LinkTimeout(f"no answer to '*IDN?' within {patience_s:g} s{last}")

    def _skip_answers(self, repeats: int) -> None:
        """Skip the answers to questions that were repeated, as far as they were not lost."""
        while repeats and self._next_line(self._monotonic() + _HANDSHAKE_TRY_S) is not None:
            repeats -= 1

    def synchronise(self, patience_s: float = SYNC_TIMEOUT_S) -> None:
        """Drain the input until it is quiet, then have the device return two numbers we choose.

        Devices answer in order, so that any earlier answer arrives before the numbers of its
        `register`; it may equal the first, hence two. Raise `LinkTimeout` if they do not come
        within `patience_s`, `ProtocolError` for lines without end.
        """
        self._in_step = False
        patience_s += _LINES_AHEAD * self._pace_s
        deadline_s = self._monotonic() + patience_s
        self._quiet(deadline_s)
        for _ in range(2):
            self._unanswered = 0  # what was sent before is answered by now, or lost
            self._skip_to(self._request_token(), deadline_s, patience_s)
        self._note_answer()
        self._in_step = not self._lines

    def stay_silent(self, seconds: float) -> None:
        """Send nothing for a while; what comes is no answer. Raises `EmergencyStop` as any wait."""
        deadline_s = self._monotonic() + seconds
        while self._next_line(deadline_s) is not None:
            self._in_step = False

    def stop(self) -> None:
        """End the current wait and every later one with `EmergencyStop`; safe from any thread."""
        self._stopped = True

    def go_on(self) -> None:
        self._stopped = False

    def close(self) -> None:
        self._port.close()

    def _get_into_step(self) -> None:
        # Lines that wait here were sent unasked, or are late: the next answer would be one of them.
        if not self._in_step or self._lines or self._take(0.0):
            self.synchronise()

    def _twice(self, asked: Callable[[], _Value]) -> _Value:
        try:
            return asked()
        # A late answer (`LinkTimeout`) is not asked for again: the output must go off in time.
        except ProtocolError:
            self.synchronise(ANSWER_TIMEOUT_S)
            return asked()

    def _only_answer(self, query: str) -> str:
        answer = self.ask(query)
        # One of the two is unsolicited, and nothing says which.
        if self._lines:
            raise ProtocolError(f"the device must answer {query!r} with one line, got two")
        return answer

    def _only_block(self, query: str, deadline_s: float) -> bytes:
        self._get_into_step()
        self.tell(query)
        self._in_step = False
        answer, until_s = BlockBuffer(), deadline_s
        while (whole := answer.feed(chunk := self._slice(until_s))) is None:
            if chunk:
                until_s = min(deadline_s, self._monotonic() + _CUT_SHORT_S)
            if self._monotonic() >= until_s:
                raise self._missing(query, answer.pending)
        content, rest = whole
        if rest:
            raise ProtocolError(f"the device must answer {query!r} with one block, got more")
        self._in_step = True
        return content

    def _beside_token(self, queries: Sequence[str]) -> list[str]:
        """Return the answers to a compound query that starts with one for the register."""
        token, register = next(self._tokens), self.register
        # `;:` begins each query at the root, whatever the one before it was.
        line = ";:".join((f"{register.put.format(token)};{register.get}", *queries))
        told, *answers = fields(self._only_answer(line), 1 + len(queries))
        if not register.is_told(told, token):
            raise ProtocolError(f"the device must answer with {token} first, got {told!r}")
        return answers

    def _between_tokens(self, queries: Sequence[str]) -> list[str]:
        """Return the answers to separate queries, enclosed by two queries for the register."""
        self._get_into_step()
        self._in_step = False
        self._expect_token()
        answers = []
        for query in queries:
            self.tell(query)
            answers.append(text(self._line(query, self._deadline_s())))
        self._expect_token()
        self._in_step = not self._lines
        return answers

    def _expect_token(self) -> None:
        token = self._request_token()
        told = text(self._line(self.register.get, self._deadline_s()))
        if not self.register.is_told(told, token):
            raise ProtocolError(f"the device must answer with {token}, got {told!r}")

    def _deadline_s(self) -> float:
        return self._monotonic() + self.timeout_s

    def _request_token(self) -> int:
        """Store the next number in the register, ask for it, and return it."""
        token = next(self._tokens)
        self.tell(self.register.put.format(token))
        self.tell(self.register.get)
        return token

    def _line(self, query: str, deadline_s: float) -> bytes:
        line = self._next_line(deadline_s)
        if line is None:
            raise self._missing(query, self._buffer.pending)
        self._note_answer()
        return line

    def _note_answer(self) -> None:
        """Measure how long the device took for each line since its last answer."""
        self._took_s.append((self._monotonic() - self._asked_s) / max(self._unanswered, 1))
        self._unanswered = 0

    @staticmethod
    def _missing(query: str, heard: bytes) -> DeviceError:
        # A part of an answer is garbled, which is worth a repetition; nothing at all is not.
        if heard:
            return ProtocolError(f"the answer to {query!r} was cut short, got {heard[:40]!r}")
        return LinkTimeout(f"no answer to {query!r} in time")

    def _next_line(self, deadline_s: float) -> bytes | None:
        """Return the next line, or None if it is incomplete at the deadline."""
        while not self._lines:
            if self._monotonic() >= deadline_s:
                return None
            self._lines += self._buffer.feed(self._slice(deadline_s))
        return self._lines.pop(0)

    def _slice(self, deadline_s: float) -> bytes:
        """Return what arrives until the deadline, or before the stop is looked at again."""
        left_s = deadline_s - self._monotonic()
        chunk = self._received(min(max(left_s, 0.0), _SLICE_S))
        # The bytes are dropped, so that what answers them is no longer certain.
        if self._stopped:
            self._in_step = False
            raise EmergencyStop("stopped by hand")
        return chunk

    def _take(self, timeout_s: float) -> bytes:
        chunk = self._received(timeout_s)
        # The clock of the pause starts anew with each byte that comes.
        if chunk:
            self._lines += self._buffer.feed(chunk)
        return chunk

    def _received(self, timeout_s: float) -> bytes:
        self.alive()
        try:
            return self._port.receive(timeout_s)
        except PORT_ERRORS as error:
            self._in_step = False
            raise DeviceError(f"the device is gone: {error}") from error

    def _quiet(self, deadline_s: float) -> bytes:
        """Read until nothing arrives for a while, discard it; return a line without its end."""
        heard = 0
        while self._take(_QUIET_S):
            heard += len(self._lines)
            self._lines.clear()
            # A device that never falls silent cannot be asked anything.
            if heard > MOST_LINES or self._monotonic() > deadline_s:
                raise ProtocolError("the device keeps sending unsolicited lines")
        self._lines.clear()
        unended = self._buffer.pending
        self._buffer.clear()
        return unended

    def _skip_to(self, token: int, deadline_s: float, patience_s: float) -> None:
        for _ in range(MOST_LINES):
            line = self._next_line(deadline_s)
            if line is None:
                break
            # Lines before it are answers to earlier queries, and are dropped.
            if line.isascii() and self.register.is_told(line.decode().strip(), token):
                return
        raise LinkTimeout(
            f"cannot get back into step: {self.register.get!r} was not answered with {token}, "
            f"just set, within {patience_s:.2g} s (an earlier answer may be outstanding)"
        )


def _require_none_for_people(line: bytes, *, ended: bool = True) -> None:
    """Raise `ProtocolError` if `line` is one of a port for people, which echoes and prompts."""
    prompt = matched[0] if (matched := _PROMPT.match(line)) else b""
    rest = line.removeprefix(prompt)
    if rest == b"*IDN?":
        raise ProtocolError(f"the device echoes commands; switch its echo off{_FOR_PEOPLE}")
    # A start-up may write `boot>` and end the line; a prompt waits, or stands before an answer.
    if prompt and (b"," in rest or not (rest or ended)):
        raise ProtocolError(f"the device sends a prompt, {prompt!r}{_FOR_PEOPLE}")


def open_link(url: str) -> Link:
    """Return a link over the port at `url`, opened for exclusive use; raises as `open_port`."""
    return Link(open_port(url))
