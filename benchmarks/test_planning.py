"""How fast plans are drawn, against work of the same kind that others do."""

from time import perf_counter

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare
from protocol.plan.plan import plan
from protocol.proof.trial_checks import cohort_problems
from protocol.study_file.loading import parsed_study, template


@pytest.mark.parametrize("name", ["paper", "extended"])
def test_a_thousand_participants_are_planned(benchmark: BenchmarkFixture, name: str) -> None:
    """At most as long as reading the study file a thousand times."""
    text = template(name)
    study = parsed_study(text)
    start = perf_counter()
    for _ in range(100):
        parsed_study(text)
    reading_s = 10 * (perf_counter() - start)
    plans = benchmark.pedantic(lambda: [plan(study, slot) for slot in range(1_000)], rounds=5)
    work = f"plan 1,000 participants of the study {name}"
    took_s = benchmark.stats["min"]
    compare(
        benchmark, work, "read the study file as often", [took_s], [reading_s], "proved balanced"
    )
    assert cohort_problems(study, plans[:40]) == []
    assert benchmark.stats["min"] < reading_s
