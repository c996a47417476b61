"""Recordings: what is packed is unpacked, and any damage is noticed."""

import json
import struct
from base64 import b64encode
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.journal.records import FULL_SCALE, MOST_COUNTS, DamagedSamplesError, Recording

COUNTS = st.lists(
    st.tuples(*3 * [st.integers(-FULL_SCALE - 1, FULL_SCALE)]), min_size=0, max_size=50
)


def recording(samples: list[tuple[int, ...]]) -> Recording:
    planes = [count for channel in zip(*samples, strict=True) for count in channel]
    return Recording.packed(
        struct.pack(f"<{len(planes)}h", *planes),
        source="board",
        rate_hz=1000.0,
        first_s=12.5,
        scale=(2.5e-4, 5e-4, 1e-5),
        clock_offset_s=100.0,
        clock_error_s=0.001,
        moved_s=(115.5, 117.5),
        tare_n=None,
        saturated=0,
    )


@given(COUNTS)
def test_samples_survive_the_journal(samples: list[tuple[int, ...]]) -> None:
    stored = json.dumps(recording(samples).to_json())
    found = Recording.from_json(json.loads(stored))
    assert found.count == len(samples)
    counts = struct.unpack(f"<{3 * found.count}h", found.counts())
    channels = [counts[n * found.count : (n + 1) * found.count] for n in range(3)]
    assert list(zip(*channels, strict=True)) == samples


@pytest.mark.parametrize(
    "damaged",
    [
        {"samples": "no base64!"},
        {"samples": b64encode(b"not compressed").decode()},
        {"count": 3},
        {"count": 1},
        {"count": -1},
        {"sha256": "0" * 64},
    ],
)
def test_damaged_samples_are_refused(damaged: dict[str, object]) -> None:
    whole = recording([(1, 2, 3), (4, 5, 6)])
    with pytest.raises(DamagedSamplesError, match="samples"):
        replace(whole, **damaged).counts()  # type: ignore[arg-type]


def test_samples_that_only_fill_the_memory_are_not_unpacked() -> None:
    """Their digest is right: who made them has made it, too."""
    one = recording([(1, 2, 3)]).to_json()
    known = {
        name: value for name, value in one.items() if name not in {"samples", "sha256", "count"}
    }
    bomb = Recording.packed(bytes(6 * (MOST_COUNTS + 1)), **known)
    assert len(bomb.samples) < 100_000
    with pytest.raises(DamagedSamplesError, match="samples cannot be 1000001 in number"):
        bomb.counts()
