"""What the friction model costs, against passes of `np.sin` over the same array in the same run."""

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.integrate import quad

import touchbeam
from analysis.model.predict import PredictOptions, predict
from benchmarks.compared import compare, tell
from benchmarks.study_scenes import study_scenes
from device.beam.beam import Beam
from device.beam.modes import mode_constants
from device.friction.coefficient import (
    Chosen,
    auto_prediction,
    friction_coefficient,
    scene_batch,
)
from device.friction.prediction import Batch, LawChoice, rung_prediction
from device.friction.rungs import (
    REDUCED_RUNG,
    TOP_RUNG,
    forget_set_ups,
    reference_tip_speed_m_s,
    rung_field,
)
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


@pytest.mark.parametrize(
    ("rung", "limit"), [("far-field", 15), ("mode", 15), (REDUCED_RUNG, 75), (TOP_RUNG, 15)]
)
def test_a_thousand_places(benchmark: BenchmarkFixture, rung: str, limit: int) -> None:
    scene = Scene()

    def work() -> object:
        return friction_coefficient(scene, rung=rung, x_m=PLACES)

    work()
    what = f"friction at 1,000 places, rung {rung}"
    assert _against_sine(benchmark, work, what, accuracy=_off_the_top(rung)) <= limit


@pytest.mark.parametrize(("rung", "limit"), [("mode", 25), ("auto", 35)])
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


def test_set_up_of_the_top_rung_with_its_resonance(benchmark: BenchmarkFixture) -> None:
    reference_tip_speed_m_s(TOP_RUNG)

    def work() -> object:
        forget_set_ups()
        return rung_field(TOP_RUNG, Beam(), Drive())

    what = "set the top rung up, and find its resonance"
    assert _against_sine(benchmark, work, what, repeats=10) <= 500


def test_quad_at_every_place_is_what_a_user_would_write(benchmark: BenchmarkFixture) -> None:
    c = mode_constants(6)
    b, sigma = c.root, c.sigma

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


@pytest.mark.parametrize("tolerance", [0.1, 0.02])
def test_auto_against_always_the_top_rung(benchmark: BenchmarkFixture, tolerance: float) -> None:
    text = study_scenes()

    def run(options: PredictOptions) -> str:
        forget_set_ups()
        return predict("study.csv", text, options)

    auto, top = PredictOptions(tolerance=tolerance), PredictOptions(rung=TOP_RUNG)
    run(auto)
    pairs = [(_quickest(lambda: run(auto), 1), _quickest(lambda: run(top), 1)) for _ in range(9)]
    what = f"predict a study's scenes, certified to {tolerance} of μ'"
    ratio = compare(benchmark, what, "always the top rung", *zip(*pairs, strict=True))
    benchmark.pedantic(run, args=(auto,), rounds=3)
    assert ratio < 1


def _drives(count: int, *, resonant: bool) -> Batch:
    """Touches of the paper's beam, each with its own damping and, off resonance, frequency."""
    draw = np.random.default_rng(2)
    scene = Scene(touch=FingerContact(finger_load_n=0.5))
    frequency_hz = draw.uniform(1.5e4, 3.0e4, count)
    return replace(
        scene_batch(scene, draw.uniform(0.01, 0.1, count)),
        frequency_hz=np.full(count, np.nan) if resonant else frequency_hz,
        damping_ratio=draw.uniform(0.003, 0.012, count),
        voltage_v=draw.uniform(0.0, 200.0, count),
    )


@pytest.mark.parametrize("rung", ["far-field", "mode", REDUCED_RUNG, TOP_RUNG])
def test_many_drives(benchmark: BenchmarkFixture, rung: str) -> None:
    batch = _drives(300, resonant=False)

    def work() -> object:
        if rung == TOP_RUNG:
            forget_set_ups()
        return rung_prediction(batch, rung, LawChoice())

    work()
    sine = _quickest(lambda: np.sin(PLACES), 400)
    passes = _quickest(work, 2) / sine / batch.size
    tell(
        benchmark,
        f"300 drives that all differ, rung {rung}",
        passes_of_np_sin_over_1000_places=f"{passes:.3g} for each drive",
    )
    benchmark.pedantic(work, rounds=1)
    if rung == REDUCED_RUNG:
        assert passes <= 60


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("resonant", [True, False])
def test_auto_where_every_drive_differs(
    benchmark: BenchmarkFixture, tolerance: float, *, resonant: bool
) -> None:
    batch = _drives(300, resonant=resonant)

    def top() -> object:
        forget_set_ups()
        return rung_prediction(batch, TOP_RUNG, LawChoice())

    def auto() -> Chosen:
        forget_set_ups()
        return auto_prediction(batch, LawChoice(), tolerance)

    chosen = auto()
    pairs = [(_quickest(auto, 1), _quickest(top, 1)) for _ in range(3)]
    names, counts = np.unique(chosen.rung, return_counts=True)
    shares = zip(counts / batch.size, names, strict=True)
    taken = "rung " + ", ".join(f"{name} for {share:.0%}" for share, name in shares)
    drives = "at resonance" if resonant else "at any frequency"
    what = f"300 drives {drives} that all differ, certified to {tolerance:g} of μ'"
    ratio = compare(benchmark, what, "always the top rung", *zip(*pairs, strict=True), taken)
    benchmark.pedantic(auto, rounds=1)
    assert ratio < (0.5 if 1e-6 <= tolerance <= 1e-2 else 1.1)
