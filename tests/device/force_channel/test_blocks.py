"""The content of a block of samples: whole, or refused."""

from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.errors import ProtocolError
from device.force_channel.recording import Block, decoded, encoded, most_in_block

COUNTS = st.integers(-32_768, 32_767)
BLOCKS = st.builds(
    lambda first, first_s, rows, lost: Block(
        first=first,
        first_s=first_s,
        counts=array("h", [count for row in rows for count in row]),
        lost=lost,
    ),
    st.integers(0, 2**32 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.lists(st.tuples(COUNTS, COUNTS, COUNTS), max_size=60),
    st.booleans(),
)


@given(BLOCKS)
def test_a_block_comes_back_as_it_was(block: Block) -> None:
    assert decoded(encoded(block)) == block


@given(BLOCKS, st.data())
def test_a_block_in_which_a_byte_differs_is_refused(block: Block, data: st.DataObject) -> None:
    content = bytearray(encoded(block))
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    with pytest.raises(ProtocolError, match="differs from its digest"):
        decoded(bytes(content))


@given(BLOCKS, st.data())
def test_a_block_that_is_cut_short_is_refused(block: Block, data: st.DataObject) -> None:
    content = encoded(block)
    with pytest.raises(ProtocolError, match="a block of samples"):
        decoded(content[: data.draw(st.integers(0, len(content) - 1))])


@given(st.binary(max_size=400))
def test_any_bytes_are_refused_by_the_codecs_own_error(content: bytes) -> None:
    with pytest.raises(ProtocolError, match="a block of samples"):
        decoded(content)


@given(st.integers(50, 1000))
def test_a_block_holds_at_most_50_ms(rate_hz: int) -> None:
    assert 1 <= most_in_block(rate_hz) <= 0.05 * rate_hz
