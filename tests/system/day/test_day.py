"""Days in the laboratory: dozens in every run, thousands with `make soak`."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from tests.system.day.day import day

SEEDS = 80
SOAKED = 5000
_A_BATCH = 10


@pytest.mark.parametrize("first", range(0, SEEDS, _A_BATCH))
def test_days_keep_every_invariant(first: int) -> None:
    for seed in range(first, first + _A_BATCH):
        done = day(seed)
        assert done.happened["killed"] >= 1, "and resumed, or the day would not have ended"
        assert done.happened["broken"] >= 2
        assert done.happened["command"] >= 1
        assert len(done.lab.watch.planned) >= 3


def test_a_study_amended_just_before_a_warning_is_not_the_next_event_of_the_session() -> None:
    day(770)


def test_a_day_is_always_the_same() -> None:
    first, second = day(7), day(7)
    assert first.lab.disk.acknowledged == second.lab.disk.acknowledged
    assert first.lab.device.now_s() == second.lab.device.now_s()


def broken(seed: int) -> str:
    """Return what does not hold on a day, empty if everything does."""
    try:
        day(seed)
    except AssertionError as error:
        return f"{seed}: {error}"
    return ""


@pytest.mark.soak
def test_thousands_of_days_keep_every_invariant() -> None:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        violations = [text for text in pool.map(broken, range(SOAKED), chunksize=50) if text]
    assert not violations, "\n".join(violations)
