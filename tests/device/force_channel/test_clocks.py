"""The offset between two clocks: the truth lies within the stated error, whatever the delays."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.force_channel.recording import QUERIES, asked_offset, throughout

DELAYS = st.lists(
    st.tuples(st.floats(0, 0.2), st.floats(0, 0.2)), min_size=2 * QUERIES, max_size=2 * QUERIES
)


class Source:
    """A clock that lies `offset_s` behind the host's, behind a line with delays."""

    def __init__(self, offset_s: float, delays: list[tuple[float, float]]) -> None:
        self.host_s = 100.0
        self.offset_s = offset_s
        self._delays = iter(delays)

    def told_s(self) -> float:
        there_s, back_s = next(self._delays)
        told_s = self.host_s + there_s - self.offset_s
        self.host_s += there_s + back_s
        return told_s


@given(st.floats(-1e4, 1e4), DELAYS)
def test_the_true_offset_lies_within_the_stated_error(
    offset_s: float, delays: list[tuple[float, float]]
) -> None:
    source = Source(offset_s, delays)
    start = asked_offset(source.told_s, lambda: source.host_s)
    shortest_s = min(sum(delay) for delay in delays[:QUERIES])
    assert start.error_s == pytest.approx(shortest_s / 2, abs=1e-9)
    assert abs(start.offset_s - offset_s) <= start.error_s + 1e-9
    end = asked_offset(source.told_s, lambda: source.host_s)
    whole = throughout((start, end))
    assert abs(whole.offset_s - offset_s) <= whole.error_s + 1e-9


@given(st.floats(-0.1, 0.1), DELAYS)
def test_clocks_that_drift_have_an_error_that_says_so(
    drift_s: float, delays: list[tuple[float, float]]
) -> None:
    source = Source(5.0, delays)
    start = asked_offset(source.told_s, lambda: source.host_s)
    source.offset_s += drift_s
    whole = throughout((start, asked_offset(source.told_s, lambda: source.host_s)))
    for offset_s in (5.0, 5.0 + drift_s):
        assert abs(whole.offset_s - offset_s) <= whole.error_s + 1e-9
