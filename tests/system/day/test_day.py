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


def test_a_day_depends_on_its_seed_alone() -> None:
    seeds = (5, 7, 12, 1283, 1284)
    forwards = {seed: day(seed).digest() for seed in seeds}
    assert {seed: day(seed).digest() for seed in reversed(seeds)} == forwards


def test_a_day_is_the_same_in_every_process() -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(digest, 1284).result() == digest(1284)


def digest(seed: int) -> str:
    """Return the digest of the record of a day."""
    return day(seed).digest()


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
