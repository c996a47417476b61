"""How much faster than a person a virtual session is."""

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare
from protocol.plan.plan import plan
from protocol.plan.trials import session_s
from protocol.study_file.loading import parsed_study, template

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))
REPEATS = 8


def test_a_session_of_40_trials_is_100_times_faster_than_real_time(
    benchmark: BenchmarkFixture,
) -> None:
    text = template("paper").replace(
        'order = "williams"', f'order = "williams"\nrepeats = {REPEATS}'
    )
    study = parsed_study(text)
    planned = plan(study, 0)
    assert sum(trial.kind == "trial" for trial in planned.trials) == 40

    def run() -> float:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "study.toml").write_text(text)
            start = perf_counter()
            subprocess.run(
                [TOUCHBEAM, "run", folder, "--participant", "P01", "--ratings", "virtual"],
                check=True,
                capture_output=True,
            )
            return perf_counter() - start

    took_s = benchmark.pedantic(run, rounds=1)
    work, peer = "a rehearsed session of 40 scored trials", "the same session with a person"
    compare(benchmark, work, peer, [took_s], [session_s(study, planned)])
    assert session_s(study, planned) >= 100 * took_s
