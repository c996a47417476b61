"""The same numbers on other processors: reports and friction, computed as several processors would.

Child processes let numpy, BLAS and the C library choose other instructions than they would here.
"""

import json
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from analysis.estimates import FloatArray
from analysis.loading.study_data import StudyData
from analysis.report.report import report, report_json
from analysis.report.results import paragraphs
from analysis.simulation import Simulation
from device.beam.beam import Beam, Patch
from device.friction.coefficient import scene_batch
from device.friction.prediction import LawChoice, rung_prediction
from device.friction.rungs import TOP_RUNG, rung_resonance_hz
from device.friction.scenes import Scene, Structure
from device.people.person import SENSITIVE
from tests.analysis.reports import ORIGIN, PAPER, imported
from tests.analysis.simulated_data import simulated_data

NEAR, SMALL = 1e-7, 1e-3
"""Numbers agree within `NEAR` of the larger one, or of `SMALL`."""
NEAR_FRICTION = 1e-9
"""Predicted μ' agrees within this."""
AVX512 = ("AVX512F", "AVX512CD", "AVX512_SKX")
AVX2 = ("AVX2", "FMA3")
PUBLISHED = Path(__file__).parents[1] / "data/published_scores.csv"
REPORTED_AS = {"Prescott": "Katmai"}
"""What OpenBLAS calls a core, if it is not what it was asked for."""


@dataclass(frozen=True, kw_only=True)
class Processor:
    """What a processor lacks of numpy's features, its core for OpenBLAS, and threads.

    `fma` is whether the C library may use fused multiplications.
    """

    lacks: tuple[str, ...] = ()
    core: str = ""
    threads: int = 1
    fma: bool = True

    @property
    def variables(self) -> dict[str, str]:
        """Environment variables that let libraries compute as on this processor; empty: unset."""
        return {
            "NPY_DISABLE_CPU_FEATURES": " ".join(self.lacks),
            "OPENBLAS_CORETYPE": self.core,
            "OPENBLAS_NUM_THREADS": str(self.threads),
            # A second thread sleeps at once when it has nothing to do, instead of using up a core.
            "OPENBLAS_THREAD_TIMEOUT": "4",
            "GLIBC_TUNABLES": "" if self.fma else "glibc.cpu.hwcaps=-AVX2,-FMA",
        }


OTHERS = {
    "Skylake, two threads": Processor(core="SkylakeX", threads=2),
    "Haswell": Processor(lacks=AVX512, core="Haswell"),
    "Sandy Bridge": Processor(lacks=AVX2 + AVX512, core="Sandybridge", fma=False),
    "Prescott": Processor(lacks=AVX2 + AVX512, core="Prescott", fma=False),
}


def demo(people: int = 9) -> StudyData:
    return simulated_data(Simulation(study=PAPER, population=SENSITIVE), people, 1)


def scored(scores: ArrayLike) -> StudyData:
    """The demo with other scores, a row for each person."""
    given = np.array(scores, dtype=float)
    data = demo(len(given))
    table = replace(data.table, scores=given)
    by_person = table.by_subject()
    who = zip(data.trials["participant"], data.trials["condition"], strict=True)
    column = np.array([by_person[person].get(name) for person, name in who], dtype=float)
    return replace(data, table=table, trials=data.trials.assign(score=column))


SMALL_TABLES: dict[str, Callable[[], StudyData]] = {
    "one person": lambda: demo(1),
    "three people": lambda: demo(3),
    "separated": lambda: scored([[7, 5, 8, 9, 4]] * 3),
}


BEAMS = {
    "paper": Beam(),
    "aluminium": Beam(
        length_m=0.12, thickness_m=3e-3, youngs_modulus_pa=70e9, density_kg_m3=2700.0
    ),
    "one-sided": Beam(supports=("free", "free"), patches=(Patch(centre_m=0.03, faces="upper"),)),
    "pinned": Beam(supports=("pinned", "pinned"), patches=(Patch(centre_m=0.05),)),
    "slender": Beam(supports=("clamped", "clamped"), thickness_m=3e-4),
}
MODES, DETUNED, DAMPING = (1, 2, 6, 9), (1.0, 1.001, 0.97), (1e-8, 5e-3, 0.2)


def friction() -> dict[str, list[float]]:
    """Return μ' of each beam along it, at and beside resonances, for narrow and wide fingers."""
    values = {}
    for name, beam in BEAMS.items():
        own_hz = [rung_resonance_hz(TOP_RUNG, beam, mode) for mode in MODES]
        # Drives are given as numbers, which a user would type.
        hz, damping, contact_m = (
            axis.ravel()
            for axis in np.meshgrid(
                np.round(np.multiply.outer(own_hz, DETUNED), 2), DAMPING, (1e-3, 1e-2, 5e-2)
            )
        )
        places_m = np.tile(np.linspace(0.0, beam.length_m, 21), hz.size)
        batch = scene_batch(Scene(structure=Structure(beam=beam)), places_m)
        batch = replace(
            batch,
            contact=replace(batch.contact, contact_m=np.repeat(contact_m, 21)),
            frequency_hz=np.repeat(hz, 21),
            damping_ratio=np.repeat(damping, 21),
        )
        for law in ("consistent", "coulomb"):
            prediction = rung_prediction(batch, TOP_RUNG, LawChoice(name=law))
            values[f"{name}, {law}"] = prediction.mu_effective.tolist()
    return values


def computed(file: Path) -> dict[str, Any]:
    """Return what this process computes with, the reports on the pickled data, and friction."""
    from threadpoolctl import threadpool_info

    reports = {}
    for name, data in pickle.loads(file.read_bytes()).items():
        made = report("a study", data, PAPER, ORIGIN)
        numbers = {**report_json(made), "paragraphs": list(paragraphs(made))}
        reports[name] = {key: value for key, value in numbers.items() if key != "provenance"}
    blas = [each for each in threadpool_info() if each["internal_api"] == "openblas"]
    return {
        "features": np.show_config(mode="dicts")["SIMD Extensions"]["found"],
        "cores": sorted({each["architecture"] for each in blas}),
        "threads": sorted({each["num_threads"] for each in blas}),
        "c_library": hash(tuple(math.exp(number / 1000) for number in range(-20_000, 20_000))),
        "reports": reports,
        "friction": friction(),
    }


def child(file: Path, processor: Processor) -> dict[str, Any]:
    """Return what a child process computes as this processor would."""
    set_ = {name: value for name, value in processor.variables.items() if value}
    others = {name: value for name, value in os.environ.items() if name not in processor.variables}
    done = subprocess.run(
        [sys.executable, "-m", "tests.system.test_same_numbers", file],
        env={**others, **set_},
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        check=True,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def differences(found: object, expected: object, where: str = "") -> Iterator[str]:
    """Yield each place where two reports differ, with both values."""
    match found, expected:
        case dict(), dict():
            for key in {**expected, **found}:
                yield from differences(found.get(key), expected.get(key), f"{where}.{key}")
        case list(), list() if len(found) == len(expected):
            for number, pair in enumerate(zip(found, expected, strict=True)):
                yield from differences(*pair, f"{where}[{number}]")
        case ((int() | float()), (int() | float())):
            if abs(found - expected) > NEAR * max(abs(found), abs(expected), SMALL):
                yield f"{where}: {found!r} instead of {expected!r}"
        case _ if found != expected:
            yield f"{where}: {found!r} instead of {expected!r}"


def assert_same_numbers(here: Mapping[str, Any], file: Path, processor: Processor) -> None:
    """Assert that a child process computed otherwise, and found the same."""
    present, core = set(here["features"]), REPORTED_AS.get(processor.core, processor.core)
    if processor.core == "SkylakeX" and not present.issuperset(AVX512):
        pytest.skip("this processor has no AVX-512")
    if "AVX2" not in present and here["cores"] == [core]:
        pytest.skip("this processor is no newer")
    found = child(file, replace(processor, lacks=tuple(present.intersection(processor.lacks))))
    assert set(found["features"]) == present.difference(processor.lacks)
    assert found["cores"] == [core]
    assert found["threads"] == [min(processor.threads, os.cpu_count() or 1)]
    if "FMA3" in present:
        assert (found["c_library"] == here["c_library"]) is processor.fma
    apart = list(differences(found["reports"], here["reports"]))
    assert not apart, "\n".join([f"{len(apart)} differ:", *apart[:40]])
    for name, values in here["friction"].items():
        assert np.abs(np.subtract(found["friction"][name], values)).max() < NEAR_FRICTION, name


@pytest.fixture(scope="module")
def pickled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("studies") / "studies.pickle"
    tables = {"demo": demo, **SMALL_TABLES}
    file.write_bytes(pickle.dumps({name: data() for name, data in tables.items()}))
    return file


@pytest.fixture(scope="module")
def here(pickled: Path) -> dict[str, Any]:
    return child(pickled, Processor())


@pytest.mark.parametrize("processor", OTHERS.values(), ids=OTHERS)
def test_reports_have_the_same_numbers_on_another_processor(
    processor: Processor, pickled: Path, here: dict[str, Any]
) -> None:
    assert_same_numbers(here, pickled, processor)


def test_a_difference_of_reports_is_found() -> None:
    expected = {"n": [1.0, None], "p": 1e-5, "said": "given"}
    near = {"n": [1.00000005, None], "p": 1.000001e-5, "said": "given"}
    assert not list(differences(near, expected))
    others = {"n": [1.0000002, None]}, {"n": [1.0, 2.0]}, {"p": 1.0001e-5}, {"said": "withheld"}
    for other in others:
        assert len(list(differences({**expected, **other}, expected))) == 1
    assert list(differences({}, expected))


PEOPLE, TABLES, AT_ONCE = (1, 2, 3, 3, 5, 9), 500, 25


def any_scores(number: int) -> FloatArray:
    """Scores of few or many people who differ, agree, or give few or the same scores."""
    rng = np.random.default_rng([17, number])
    people = PEOPLE[number % len(PEOPLE)]
    lowest = int(rng.choice([0, 1, 5, 8, 10]))
    if rng.random() < 0.2:
        return np.tile(rng.integers(lowest, 11, 5), (people, 1)).astype(float)
    if rng.random() < 0.2:
        return np.clip(np.round(np.linspace(5, 9, 5) + rng.normal(0, 1, (people, 5))), 0, 10)
    return rng.integers(lowest, 11, (people, 5)).astype(float)


def published() -> StudyData:
    rows = np.array([line.split(",") for line in PUBLISHED.read_text(encoding="utf-8").split()])
    return imported(rows[1:, 1:6], names=tuple(rows[0, 1:6]))


@pytest.mark.soak
@pytest.mark.parametrize("processor", OTHERS.values(), ids=OTHERS)
def test_any_tables_have_the_same_numbers(processor: Processor, tmp_path: Path) -> None:
    tables = {str(number): scored(any_scores(number)) for number in range(TABLES)}
    queue = list({"published": published(), "two people": demo(2), **tables}.items())
    for begin in range(0, len(queue), AT_ONCE):
        file = tmp_path / f"{begin}.pickle"
        file.write_bytes(pickle.dumps(dict(queue[begin : begin + AT_ONCE])))
        assert_same_numbers(child(file, Processor()), file, processor)


if __name__ == "__main__":
    json.dump(computed(Path(sys.argv[1])), sys.stdout)
