"""What a simulated session costs, against the same session with device, link and journal."""

import tempfile
from pathlib import Path
from time import process_time

from pytest_benchmark.fixture import BenchmarkFixture

from analysis.simulation import Simulation
from benchmarks.compared import compare
from protocol.study_file.loading import parsed_study, template
from tests.system.in_process_sessions import loaded_rehearsals

PEOPLE, COHORTS = 9, 200


def test_a_simulated_session_is_a_thousand_times_cheaper(benchmark: BenchmarkFixture) -> None:
    text = template("paper")
    simulation = Simulation(study=parsed_study(text))
    simulation.studies(PEOPLE, 0)  # plans and fields are set up once per study

    def simulated() -> float:
        start_s = process_time()
        simulation.studies(PEOPLE, *range(COHORTS))
        return (process_time() - start_s) / (PEOPLE * COHORTS)

    simulated_s = benchmark.pedantic(simulated, rounds=1)
    with tempfile.TemporaryDirectory() as folder:
        start_s = process_time()
        loaded_rehearsals(Path(folder), text, 2, seed=1)
        whole_s = (process_time() - start_s) / 2
    peer = "the same session with device, link and journal"
    compare(
        benchmark, "simulate a session's scores", peer, [simulated_s], [whole_s], "the same scores"
    )
    assert whole_s >= 1000 * simulated_s
