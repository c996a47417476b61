"""Days in the laboratory: dozens in every run, thousands with `make soak`."""

import gc
import random
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

from device.guardian import Pulse
from device.rig import Rig
from protocol.study.rules import Rating
from protocol.study.touch import Touch
from runner.journal.names import STUDY_CHAIN
from runner.session.trial import _Stimulus
from tests.system.day.day import day
from tests.system.day.invariants import Violation
from tests.system.day.lab import Lab
from tests.system.day.studies import drawn_study

# On these days everything happens that happens on any of the first 80.
SEEDS = (
    *(0, 2, 8, 14, 15, 19, 20, 21, 24, 29, 33, 34, 35, 37, 38, 39),
    *(40, 47, 48, 50, 56, 57, 60, 62, 63, 64, 68, 69, 70, 74, 77, 78),
)
SOAKED = 5000
_A_BATCH = 8


@pytest.mark.parametrize("first", range(0, len(SEEDS), _A_BATCH))
def test_days_keep_every_invariant(first: int) -> None:
    for seed in SEEDS[first : first + _A_BATCH]:
        done = day(seed)
        assert done.happened["killed"] >= 1, "and resumed, or the day would not have ended"
        assert done.happened["broken"] >= 2
        assert done.happened["command"] >= 1
        assert len(done.lab.watch.planned) >= 3


def test_days_find_a_program_that_does_not_look_at_the_gap_before_a_sign_of_life(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On this day a program stands still in a touch of a generator without a guardian."""
    seed = 98
    assert day(seed).happened["stood still"] == 1
    monkeypatch.setattr(Pulse, "broken", lambda _: "")
    monkeypatch.setattr(Rig, "_silence", lambda _: "")
    # A second check finds most of them, too: the touch then ends over a second late.
    monkeypatch.setattr(_Stimulus, "require_as_long_as_planned", lambda _: None)
    with pytest.raises(AssertionError, match="a touch counts that stood still"):
        day(seed)


@pytest.mark.parametrize(("seed", "rule"), [(0, "noticed"), (10, "agrees")])
def test_days_find_a_session_that_asks_for_other_scores_than_the_study(
    monkeypatch: pytest.MonkeyPatch, seed: int, rule: str
) -> None:
    assert day(seed).lab.watch.study.rating.score_when == rule
    monkeypatch.setattr(Rating, "asks_score", lambda *_, agrees, noticed: not (agrees or noticed))
    with pytest.raises(AssertionError, match=r"invariant 9 .*with the score"):
        day(seed)


@pytest.mark.parametrize(
    ("tag", "payload"), [("paused", "{}"), ("trial-aborted", '{"why": "stopped by the operator"}')]
)
def test_the_next_event_of_a_session_comes_after_the_warning_about_its_touch(
    tmp_path: Path, tag: str, payload: str
) -> None:
    stored = _stored_after_a_wrong_touch(tmp_path)
    stored(STUDY_CHAIN, "amended", "{}")  # by another process
    with pytest.raises(Violation, match="nobody was told that a touch of P01/1"):
        stored("P01/1", tag, payload)


def test_a_signal_may_end_a_session_before_the_warning_about_its_touch(tmp_path: Path) -> None:
    stored = _stored_after_a_wrong_touch(tmp_path)
    stored("P01/1", "trial-aborted", '{"index": 1, "why": "stopped by SIGTERM"}')


def _stored_after_a_wrong_touch(folder: Path) -> Callable[[str, str, str], None]:
    """Return what is called with each event of a laboratory in which a touch went wrong."""
    stream = random.Random(0)
    lab = Lab(folder, drawn_study(stream, "board"), stream, "board")
    lab.watch.touch = Touch(place="smooth", voltage_v=0)
    lab.watch.fault("banner")  # or the touch would be compared with its plan
    stored = lab.disk.on_event
    stored("P01/1", "touch-ended", '{"judged": {"force_ok": false, "place_ok": true}}')
    return stored


def test_a_day_depends_on_its_seed_alone() -> None:
    seeds = (3, 12, 1283)
    forwards = {seed: digest(seed) for seed in seeds}
    assert {seed: digest(seed) for seed in reversed(seeds)} == forwards
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(digest, 12).result() == forwards[12], "in every process"


def digest(seed: int) -> str:
    """Return the digest of the record of a day."""
    return day(seed).digest()


def prepared() -> None:
    """Let the collector of a worker look at what a day makes, and at nothing that stays."""
    broken(0)
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def broken(seed: int) -> str:
    """Return what does not hold on a day, empty if everything does."""
    try:
        day(seed)
    except (AssertionError, Violation) as error:
        return f"{seed}: {error}"
    return ""


@pytest.mark.soak
def test_thousands_of_days_keep_every_invariant() -> None:
    began_s, workers = time.monotonic(), resource.RUSAGE_CHILDREN
    before = resource.getrusage(workers)
    with ProcessPoolExecutor(2, get_context("spawn"), prepared) as pool:
        violations = [text for text in pool.map(broken, range(SOAKED), chunksize=50) if text]
    used = resource.getrusage(workers)
    cpu_s = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    minutes = (time.monotonic() - began_s) / 60
    print(
        f"\n{SOAKED} days in {minutes:.1f} min, {cpu_s / SOAKED:.2f} s of CPU each: "
        f"{len(violations)} violations"
    )
    assert not violations, "\n".join(violations)
