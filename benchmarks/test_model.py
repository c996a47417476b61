"""What the friction model costs, against passes of `np.sin` over the same array in the same run."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from time import perf_counter

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.integrate import quad
from scipy.optimize import brentq

import touchbeam
from analysis.model.predict import PredictOptions, predict
from benchmarks.compared import compare
from benchmarks.study_scenes import RIGS, SCENES_PER_RIG, study_scenes
from device.beam.beam import Beam
from device.friction.coefficient import friction_coefficient, scene_batch
from device.friction.fineness import TOLERANCES, fineness_for
from device.friction.prediction import Batch, LawChoice, rung_prediction
from device.friction.rungs import RUNG_NAMES, TOP_RUNG, rung_field, rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene

PLACES = np.linspace(0.0, 0.1, 1000)


def _quickest(work: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return min(times)


def _against_sine(
    benchmark: BenchmarkFixture,
    work: Callable[[], object],
    what: str,
    *,
    repeats: int = 200,
    accuracy: str = "",
) -> float:
    """Compare with passes of `np.sin` in turn; return the least ratio, each of quickest times."""
    ours, sines = [], []
    for _ in range(5):
        sines.append(_quickest(lambda: np.sin(PLACES), 400))
        ours.append(_quickest(work, repeats))
    compare(benchmark, what, "np.sin of 1,000 places", ours, sines, accuracy)
    benchmark.pedantic(work, rounds=3)
    return min(mine / sine for mine, sine in zip(ours, sines, strict=True))


def _off_the_top(rung: str) -> str:
    """How far a rung's μ' lies from the top rung's at most, in words."""
    found, exact = (
        friction_coefficient(Scene(), rung=name, x_m=PLACES) for name in (rung, TOP_RUNG)
    )
    return "the top rung" if rung == TOP_RUNG else f"off the top rung by {_most(found - exact)}"


def _most(difference: NDArray[np.float64]) -> str:
    return f"{np.max(np.abs(difference)):.2g} of μ' at most"


@pytest.mark.parametrize("rung", [name for name in RUNG_NAMES if name != "eq15"])
def test_a_thousand_places(benchmark: BenchmarkFixture, rung: str) -> None:
    scene = Scene()

    def work() -> object:
        return friction_coefficient(scene, rung=rung, x_m=PLACES)

    work()
    what = f"friction at 1,000 places, rung {rung}"
    assert _against_sine(benchmark, work, what, accuracy=_off_the_top(rung)) <= 25


@pytest.mark.parametrize(("rung", "limit"), [("mode", 25), ("beam", 25)])
def test_a_further_thousand_places_in_python(
    benchmark: BenchmarkFixture, rung: str, limit: int
) -> None:
    many, more = PLACES, np.linspace(0.0, 0.1, 3000)
    ours, sines = [], []
    for _ in range(5):
        sines.append(_quickest(lambda: np.sin(PLACES), 400))
        less = _quickest(lambda: touchbeam.friction(x_m=many, rung=rung), 20)
        ours.append((_quickest(lambda: touchbeam.friction(x_m=more, rung=rung), 20) - less) / 2)
    what = f"touchbeam.friction at each further 1,000 places, rung {rung}"
    compare(benchmark, what, "np.sin of 1,000 places", ours, sines)
    benchmark.pedantic(touchbeam.friction, kwargs={"x_m": many, "rung": rung}, rounds=3)
    assert min(mine / sine for mine, sine in zip(ours, sines, strict=True)) <= limit


_NUMBERS = count(1)


def _another_beam() -> Beam:
    """A beam that was not set up yet, like the paper's to 12 digits."""
    return replace(Beam(), youngs_modulus_pa=105e9 * (1 + 1e-13 * next(_NUMBERS)))


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_a_beam_is_set_up(benchmark: BenchmarkFixture, tolerance: float) -> None:
    fineness = fineness_for(tolerance)

    def work() -> object:
        return rung_field(TOP_RUNG, _another_beam(), Drive(), fineness=fineness)

    what = f"set a beam up, with its resonance and one drive, tolerance {tolerance:g}"
    assert _against_sine(benchmark, work, what, repeats=5) <= 6000


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_one_drive_more(benchmark: BenchmarkFixture, tolerance: float) -> None:
    fineness = fineness_for(tolerance)
    resonance_hz = rung_resonance_hz(TOP_RUNG, Beam(), 6)

    def work() -> object:
        drive = Drive(frequency_hz=resonance_hz * (1 + 1e-9 * next(_NUMBERS)))
        return rung_field(TOP_RUNG, Beam(), drive, fineness=fineness)

    work()
    what = f"one drive more of a beam, tolerance {tolerance:g}"
    assert _against_sine(benchmark, work, what, repeats=20) <= 600


def test_quad_at_every_place_is_what_a_user_would_write(benchmark: BenchmarkFixture) -> None:
    b = brentq(lambda b: math.cos(b) + 1 / math.cosh(b), 5 * math.pi, 6 * math.pi)
    sigma = (math.cosh(b) + math.cos(b)) / (math.sinh(b) + math.sin(b))

    def shape(xi: float) -> float:
        t = b * xi
        return abs(math.cosh(t) - math.cos(t) - sigma * (math.sinh(t) - math.sin(t)))

    def work() -> object:
        return [quad(shape, max(0.0, x - 0.1), x)[0] for x in PLACES / 0.1]

    def ours() -> object:
        return friction_coefficient(Scene(), rung="mode", x_m=PLACES)

    ours()
    pairs = [(_quickest(ours, 50), _quickest(work, 1)) for _ in range(5)]
    what = "friction at 1,000 places, rung mode (and its zones, load and law)"
    peer = "scipy's quad of the mode shape at each place"
    compare(benchmark, what, peer, *zip(*pairs, strict=True))
    benchmark.pedantic(work, rounds=3)
    assert min(theirs for _, theirs in pairs) > 1000 * _quickest(lambda: np.sin(PLACES), 400)


def _scene_table(count: int) -> str:
    draw = np.random.default_rng(1)
    columns = np.stack(
        [
            draw.uniform(0, 200, count),
            draw.uniform(2e4, 3e4, count),
            draw.uniform(0, 0.1, count),
            draw.uniform(1e-3, 2e-2, count),
            draw.uniform(0.1, 20, count),
            draw.uniform(0.002, 0.02, count),
        ]
    )
    header = "voltage_v,frequency_hz,x_m,contact_m,body_load_n,damping_ratio\n"
    return header + "\n".join(",".join(map(repr, row)) for row in columns.T.tolist()) + "\n"


def test_ten_thousand_scenes_that_all_differ(benchmark: BenchmarkFixture) -> None:
    text = _scene_table(10_000)

    def work() -> object:
        return predict("scenes.csv", text, PredictOptions(rung="mode"))

    what = "predict a table of 10,000 scenes that all differ"
    assert _against_sine(benchmark, work, what, repeats=2) / 10_000 <= 15


def test_a_study_of_six_thousand_scenes(benchmark: BenchmarkFixture) -> None:
    text = study_scenes()

    def work() -> object:
        return predict("study.csv", text)

    work()
    what = f"predict {RIGS * SCENES_PER_RIG:,} scenes with {6 * RIGS} drives, rung beam"
    assert _against_sine(benchmark, work, what, repeats=1) <= 120_000


def _drives(drives: int) -> Batch:
    """Touches of the paper's beam, each with its own damping and frequency."""
    draw = np.random.default_rng(2)
    scene = Scene(touch=FingerContact(finger_load_n=0.5))
    return replace(
        scene_batch(scene, draw.uniform(0.01, 0.1, drives)),
        frequency_hz=draw.uniform(1.5e4, 3.0e4, drives),
        damping_ratio=draw.uniform(0.003, 0.012, drives),
        voltage_v=draw.uniform(0.0, 200.0, drives),
    )


DRIVES = 600


@pytest.mark.parametrize("rung", ["mode", "own-mode"])
def test_many_drives_of_one_mode(benchmark: BenchmarkFixture, rung: str) -> None:
    batch = _drives(DRIVES)

    def work() -> object:
        return rung_prediction(batch, rung, LawChoice())

    work()
    what = f"{DRIVES} drives that all differ, rung {rung}"
    assert _against_sine(benchmark, work, what, repeats=5) / DRIVES <= 1


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_many_drives_of_the_beam(benchmark: BenchmarkFixture, tolerance: float) -> None:
    batch, fineness = _drives(DRIVES), fineness_for(tolerance)
    finest = rung_prediction(batch, TOP_RUNG, LawChoice(), fineness_for(TOLERANCES[-1]))

    def work() -> NDArray[np.float64]:
        return rung_prediction(batch, TOP_RUNG, LawChoice(), fineness).mu_effective

    off = _most(work() - finest.mu_effective)
    what = f"{DRIVES} drives that all differ, rung beam, tolerance {tolerance:g}"
    assert _against_sine(benchmark, work, what, repeats=1, accuracy=off) / DRIVES <= 200
