"""The codec on random input: it returns a valid value or raises its own error."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.errors import ProtocolError
from device.link.codec import (
    LONGEST_BLOCK,
    LONGEST_LINE,
    BlockBuffer,
    LineBuffer,
    block,
    fields,
    impedance,
    number,
    queued_error,
    switch,
    text,
    whole,
)
from tests.device.fuzz import chunks


def pair(reply: str) -> list[str]:
    """Return the answers to two queries in one line."""
    return fields(reply, 2)


PARSERS: tuple[Callable[[str], object], ...] = (
    number,
    whole,
    switch,
    queued_error,
    impedance,
    pair,
)


def digested(line: bytes) -> int:
    """Return how many parsers accept a line."""
    taken = 0
    try:
        reply = text(line)
    except ProtocolError:
        return 0
    for parse in PARSERS:
        try:
            value = parse(reply)
        except ProtocolError:
            continue
        taken += 1
        assert parse is impedance or not isinstance(value, float) or math.isfinite(value)
    return taken


def survived(seed: int, lines: int) -> tuple[int, int]:
    """Return how many random lines were parsed, and how many values they gave."""
    buffer, digest, values = LineBuffer(), 0, 0
    for chunk in chunks(seed, lines):
        try:
            whole_lines = buffer.feed(chunk)
        except ProtocolError:
            continue
        assert len(buffer.pending) <= LONGEST_LINE
        digest += len(whole_lines)
        values += sum(digested(line) for line in whole_lines)
    return digest, values


def test_random_lines_give_values_or_the_codecs_own_error() -> None:
    lines, values = survived(seed=1, lines=20_000)
    assert lines > 5_000
    assert values > 100, "some of it is well formed by chance"


@pytest.mark.soak
def test_a_million_random_lines() -> None:
    lines, values = survived(seed=2, lines=2_000_000)
    assert lines > 1_000_000
    assert values > 10_000


@given(st.lists(st.binary(max_size=80), max_size=20))
def test_any_bytes_in_any_chunks(pieces: list[bytes]) -> None:
    buffer = LineBuffer()
    for piece in pieces:
        for line in buffer.feed(piece):
            assert line
            assert b"\n" not in line
            assert b"\r" not in line
            digested(line)


@given(st.binary(max_size=LONGEST_BLOCK), st.sampled_from((b"\n", b"\r\n")), st.data())
def test_a_block_comes_back_whole_however_it_is_cut(
    content: bytes, line_end: bytes, data: st.DataObject
) -> None:
    sent = block(content) + line_end
    cut = data.draw(st.integers(0, len(sent) - len(line_end)))
    buffer = BlockBuffer()
    assert buffer.feed(sent[:cut]) is None
    assert buffer.feed(sent[cut:]) == (content, b"")


@given(st.lists(st.binary(max_size=80) | st.sampled_from((b"#", b"#3", b"010", b"\n"))))
def test_any_bytes_are_a_block_or_the_codecs_own_error(pieces: list[bytes]) -> None:
    buffer, heard = BlockBuffer(), b""
    for piece in pieces:
        heard += piece
        try:
            found = buffer.feed(piece)
        except ProtocolError:
            return
        assert len(buffer.pending) <= LONGEST_BLOCK + len("#9123456789\r\n") + len(piece)
        if found is not None:
            content, after = found
            begin = 2 + int(heard[1:2])
            assert int(heard[2:begin]) == len(content)
            assert heard[begin:].startswith(content)
            assert heard.endswith(after)
            return
