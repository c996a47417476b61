"""The wire codec, byte by byte."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.errors import DeviceError, ProtocolError
from device.link.codec import (
    LONGEST_LINE,
    LineBuffer,
    encoded,
    number,
    number_text,
    queued_error,
    switch,
    text,
    whole,
)


def test_a_command_ends_with_one_line_feed() -> None:
    assert encoded("VOLT 100") == b"VOLT 100\n"


@pytest.mark.parametrize("line", ["VOLT 1\nOUTP ON", "VÖLT 1", "VOLT\r"])
def test_a_command_with_a_line_end_or_non_ascii_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match="printable ASCII, got"):
        encoded(line)


def test_a_frequency_keeps_its_digits() -> None:
    assert number_text(24221.37) == "24221.37"


@given(st.floats(min_value=-1e9, max_value=1e9))
def test_a_number_keeps_ten_digits_on_the_wire(value: float) -> None:
    assert number(number_text(value)) == pytest.approx(value, rel=1e-9, abs=1e-300)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_only_finite_numbers_are_sent(value: float) -> None:
    with pytest.raises(ValueError, match=f"finite, got {value}"):
        number_text(value)


@pytest.mark.parametrize(
    "reply", ["", "nan", "inf", "-inf", "1_000", "9.91E37", "1,5", "0x10", "ON"]
)
def test_a_reply_that_is_not_a_number_is_refused(reply: str) -> None:
    with pytest.raises(DeviceError, match=f"with a number, got {reply!r}"):
        number(reply)


@pytest.mark.parametrize(
    ("reply", "on"), [("1", True), ("0", False), ("ON", True), (" off ", False)]
)
def test_a_switch_is_on_or_off(reply: str, on: bool) -> None:
    assert switch(reply) is on


def test_another_word_is_not_a_switch() -> None:
    with pytest.raises(DeviceError, match="1 or 0, got '2'"):
        switch("2")


def test_errors_are_distinguished_from_no_error() -> None:
    assert queued_error('0,"No error"') is None
    assert queued_error('-222,"Data out of range"') == "-222 Data out of range"
    with pytest.raises(DeviceError, match=r"such as 0,.*, got .fine."):
        queued_error("fine")


@given(st.lists(st.text("ABC123?", min_size=1), max_size=5), st.integers(1, 7))
def test_lines_are_reassembled_from_chunks_of_any_size(lines: list[str], size: int) -> None:
    stream = "".join(line + "\r\n" for line in lines).encode()
    buffer = LineBuffer()
    chunks = [stream[i : i + size] for i in range(0, len(stream), size)]
    assert [text(line) for chunk in chunks for line in buffer.feed(chunk)] == lines


def test_trailing_data_waits_for_its_end() -> None:
    buffer = LineBuffer()
    assert buffer.feed(b"one\ntw") == [b"one"]
    assert buffer.feed(b"o\n") == [b"two"]


@pytest.mark.parametrize("end", [b"", b"\n", b"\nnext\n"])
def test_a_line_that_is_too_long_is_refused(end: bytes) -> None:
    assert (
        LineBuffer().feed(b"x" * LONGEST_LINE + end)
        == [b"x" * LONGEST_LINE, b"next"][: end.count(b"\n")]
    )
    with pytest.raises(DeviceError, match=f"more than {LONGEST_LINE} bytes"):
        LineBuffer().feed(b"x" * (LONGEST_LINE + 1) + end)


def test_a_line_that_is_not_ascii_is_refused() -> None:
    with pytest.raises(DeviceError, match="in ASCII, got"):
        text(b"\xff\xfe")


@pytest.mark.parametrize(
    ("read", "reply"),
    [(queued_error, f'{"9" * 5000},"x"'), (number, "x" * 50_000), (whole, "9.5" + "1" * 5000)],
)
def test_a_refusal_shows_the_beginning_of_a_long_answer(
    read: Callable[[str], object], reply: str
) -> None:
    with pytest.raises(ProtocolError, match="the device must answer with") as refused:
        read(reply)
    assert len(str(refused.value)) < 160
