"""Rigs that are armed and driven."""

import pytest

from tests.device.rig.bench import (
    DRIVE,
    FEED_S,
    Bench,
    RecordedDriver,
)


@pytest.fixture
def bench() -> Bench:
    """An armed rig with a watchdog, which was fed just now."""
    bench = Bench(RecordedDriver())
    bench.rig.arm()
    bench.after(FEED_S)
    return bench


@pytest.fixture
def driven(bench: Bench) -> Bench:
    """The same, driven, at the end of its ramp."""
    bench.rig.drive(DRIVE)
    bench.after(FEED_S)
    return bench


@pytest.fixture
def unwatched() -> Bench:
    """A driven generator without a watchdog, which was fed just now."""
    bench = Bench(RecordedDriver(has_watchdog=False))
    bench.rig.arm()
    bench.rig.drive(DRIVE)
    bench.after(FEED_S)
    return bench
