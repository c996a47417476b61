"""A gauge that says what is not true, or nothing that is a number: refused in one line."""

import signal
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.errors import DeviceError, ProtocolError
from device.force_channel.recording import Samples
from device.gauges.gauge import LineGauge, block
from device.gauges.owner import GaugeOwner
from device.link.link import Link
from device.simulator.device import SimulatedDevice
from tests.device.lying import LINE_S, SteppedClock

SCALE = (2.5e-4, 2.5e-4, 5e-6)


class GaugePort:
    """A port with a simulated gauge behind it; `lie` is applied to every answer to `of`."""

    def __init__(self, clock: SteppedClock | None = None) -> None:
        self.clock = clock or SteppedClock()
        self.device = SimulatedDevice(seed=1, wall_s=self.clock)
        self.of = ""
        self.lie: Callable[[str], str] = str
        self._pending = b""

    def receive(self, timeout_s: float) -> bytes:
        data, self._pending = self._pending, b""
        if not data:
            self.clock.advance(timeout_s)
        return data

    def send(self, data: bytes) -> None:
        self.clock.advance(LINE_S)
        self.device.pass_time()
        line = data.decode().strip()
        answer = self.device.gauge.answer(line)
        if answer is not None:
            told = self.lie(answer) if self.of and line.startswith(self.of) else answer
            self._pending += told.encode("latin-1") + b"\n"

    def close(self) -> None: ...


@contextmanager
def gauge() -> Iterator[tuple[GaugeOwner, GaugePort]]:
    """A gauge without a thread: each call does its work."""
    port = GaugePort()
    owner = GaugeOwner(LineGauge(Link(port, monotonic=port.clock)))
    yield owner, port
    owner.close()


def lived(owner: GaugeOwner, port: GaugePort, seconds: float) -> None:
    for _ in range(round(seconds / 0.02)):
        port.clock.advance(0.02)
        owner.step()
        owner.require_sound()


def recorded(owner: GaugeOwner, port: GaugePort) -> Samples:
    owner.meet()
    owner.record(1000, port.clock)
    lived(owner, port, 1)
    return owner.recorded()


def test_an_honest_gauge_loses_nothing() -> None:
    with gauge() as (owner, port):
        samples = recorded(owner, port)
    assert len(samples.counts) / 6 == pytest.approx(1000, abs=50)
    assert samples.clock_offset_s == pytest.approx(-1000, abs=samples.clock_error_s + 1e-9)
    assert samples.clock_error_s < 1e-3


def test_a_session_that_steps_faster_than_its_gauge_waits_for_it() -> None:
    with gauge() as (owner, port):
        owner.meet()
        owner.record(1000, port.clock)
        for _ in range(10):
            port.clock.advance(0.9)
            owner.keep_up()
            owner.require_sound()
        samples = owner.recorded()
    assert len(samples.counts) / 6 == pytest.approx(9000, rel=0.1)


def _digested(body: str) -> str:
    return f"{body};{zlib.crc32(body.encode('ascii')):08X}"


def _field(number: int, value: str) -> Callable[[str], str]:
    def lie(line: str) -> str:
        parts = line.split(";")[:-1]
        parts[number] = value
        return _digested(";".join(parts))

    return lie


LIES: tuple[tuple[str, Callable[[str], str], str], ...] = (
    ("*IDN?", lambda _: "touchbeam,BOARD,1,1.2", "expected a gauge .* got 'touchbeam,BOARD"),
    ("UNIT?", lambda _: "gf", "must measure in N, got 'gf'"),
    ("UNIT?", lambda _: "", "no answer to 'UNIT.' in time"),
    ("RATE?", lambda _: "999", "RATE was set to 1000 and is 999"),
    ("RATE?", lambda _: "fast", "must answer with a number, got 'fast'"),
    ("RANG?", lambda _: "10,10", "must measure up to .*, got 10, 10"),
    ("RANG?", lambda _: "10,0,1", "must measure up to .*, got 10, 0, 1"),
    ("RANG?", lambda _: "10,3E40,1", "must answer with a number, got '3E40'"),
    ("RANG?", lambda _: "10,9E36,1", r"must measure up to .*, got 10, 9e\+36, 1"),
    ("STAT?", lambda _: "0", "was told STAR and does not"),
    ("STAT?", lambda _: "1", "was told STOP and does not"),
    ("TIME?", lambda _: "NAN", "must answer with a number, got 'NAN'"),
    ("DATA?", lambda line: line.replace("0.", "1.", 1), "differ from their digest"),
    ("DATA?", lambda line: f"{line}0", "differ from their digest"),
    ("DATA?", lambda line: line[: len(line) // 2], "differ from their digest"),
    ("DATA?", lambda line: f"{line}\n{line}", "with one line, got two"),
    ("DATA?", lambda line: f"\xb1{line}", "must answer in ASCII"),
    ("DATA?", lambda _: _digested("0;0"), "must answer with 3 fields, got '0;0'"),
    ("DATA?", _field(0, "0"), r"sample \d+ of the force channel is due, got 0 again"),
    ("DATA?", _field(0, "99999"), r"were lost: sample \d+ is due, got 99999"),
    ("DATA?", _field(0, "-1"), r"sample \d+ of the force channel is due, got -1 again"),
    ("DATA?", _field(0, "1.5"), "must answer with a whole number, got '1.5'"),
    ("DATA?", _field(1, "7"), r"sample \d+ of the force channel is .* ms from its time"),
    ("DATA?", _field(1, "INF"), "must answer with a number, got 'INF'"),
    ("DATA?", _field(2, "39"), r"must send 39 samples, got \d+"),
    ("DATA?", _field(-1, "0.1,0.2"), "a sample must have 3 values, got '0.1,0.2'"),
    ("DATA?", _field(-1, "0.1,0.2,x"), "must answer with a number, got 'x'"),
    ("DATA?", _field(-1, "0.1,1E30,0"), "a sample must lie in its range, got '0.1,1E30,0'"),
    ("DATA?", lambda line: _digested(f"{line.split(';')[0]};1000;0"), "no samples for 0.5 s"),
)


@pytest.mark.parametrize(("of", "lie", "says"), LIES)
def test_a_gauge_that_lies_is_found(of: str, lie: Callable[[str], str], says: str) -> None:
    with gauge() as (owner, port):
        port.of, port.lie = of, lie
        if of == "DATA?":
            port.of = ""
            owner.meet()
            owner.record(1000, port.clock)
            lived(owner, port, 0.2)
            port.of = of
        with pytest.raises(DeviceError, match=f"^gauge: .*({says})"):
            lived(owner, port, 1) if of == "DATA?" else recorded(owner, port)


@pytest.mark.parametrize("late_s", [1.0, -1.0])
def test_a_gauge_that_dates_its_samples_wrongly_from_the_beginning_is_found(late_s: float) -> None:
    def late(line: str) -> str:
        first_s = float(line.split(";")[1])
        return _field(1, f"{first_s + late_s:.9f}")(line)

    with gauge() as (owner, port):
        port.of, port.lie = "DATA?", late
        with pytest.raises(
            DeviceError, match=r"^gauge: the first sample .* is dated .* s from its"
        ):
            recorded(owner, port)


def test_a_gauge_whose_clock_is_set_while_it_records_is_found_at_the_end() -> None:
    with gauge() as (owner, port):
        owner.meet()
        owner.record(1000, port.clock)
        lived(owner, port, 1)
        port.of, port.lie = "TIME?", lambda line: f"{float(line) - 1:.9f}"
        with pytest.raises(DeviceError, match=r"^gauge: the clock of the force channel moved by"):
            owner.recorded()


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=200))
def test_any_line_is_refused_by_the_codecs_own_error(line: str) -> None:
    with pytest.raises(ProtocolError, match="differ from their digest"):
        block(line, SCALE)


@given(st.text("0123456789.,;-E", max_size=80))
def test_any_line_with_its_digest_is_samples_or_the_codecs_own_error(body: str) -> None:
    try:
        found = block(_digested(body), SCALE)
    except ProtocolError:
        return
    assert len(found.counts) % 3 == 0


def test_a_stop_while_a_call_is_awaited_is_no_error_of_the_gauge() -> None:
    """A signal's handler raises in the thread that waits."""

    class Stop(Exception):
        pass

    heard, over = threading.Event(), threading.Event()

    def stop(*_: object) -> None:
        if not heard.is_set():
            heard.set()
            raise Stop

    class Slow(LineGauge):
        def meet(self) -> str:
            # Again, because a signal just before the thread sleeps does not wake it.
            while not heard.wait(0.05):
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
            over.wait()
            return ""

    owner = GaugeOwner(Slow(Link(GaugePort(), monotonic=SteppedClock())))
    owner.start(lambda: None)
    before = signal.signal(signal.SIGINT, stop)
    try:
        with pytest.raises(Stop):
            owner.meet()
    finally:
        over.set()
        owner.close()
        signal.signal(signal.SIGINT, before)
