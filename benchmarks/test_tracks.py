"""QUEST+: a choice of the next level, and the fold of a whole track, beside questplus."""

from collections.abc import Callable
from random import Random
from time import process_time

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare
from device.tracks.next_level import Answer, next_level
from device.tracks.posterior import choices, lattice
from protocol.study.track import Track

LEVELS, ROUNDS, OURS_EACH = 41, 7, 100
TRACK = Track.model_validate(
    {
        "name": "measured",
        "task": "two intervals",
        "method": "quest+",
        "axis": "voltage",
        "levels": {"from": 4, "to": 160, "count": LEVELS},
        "standard": {"place": "smooth", "voltage_v": 0},
        "comparison": {"place": "smooth"},
        "trials": 200,
        # Weibull's scale is the threshold of questplus.
        "threshold_at": float(1 - np.exp(-1) / 2),
    }
)


def _theirs() -> object:
    from questplus import QuestPlus

    levels = np.array(TRACK.distances)
    return QuestPlus(
        stim_domain={"intensity": levels},
        param_domain={
            "threshold": levels,
            "slope": np.linspace(1, 5, 5),
            "lower_asymptote": 0.5,
            "lapse_rate": np.linspace(0, 0.08, 4),
        },
        outcome_domain={"response": [1, 0]},
        func="weibull",
        stim_scale="linear",
    )


def _taken(do: Callable[[], object], times: int) -> float:
    start = process_time()
    for _ in range(times):
        do()
    return (process_time() - start) / times


def _compared(benchmark: BenchmarkFixture, answers: list[Answer], *, fold: bool) -> None:
    theirs = [_theirs() for _ in range(ROUNDS)]
    weights = lattice(TRACK).weights(answers)[np.newaxis]

    def told(peer: object) -> int:
        for answer in answers if fold else ():
            stimulus = {"intensity": TRACK.distances[answer.level]}
            peer.update(stim=stimulus, outcome={"response": int(answer.correct)})  # type: ignore[attr-defined]
        chosen = peer.next_stim["intensity"]  # type: ignore[attr-defined]
        return TRACK.distances.index(chosen)

    def ours() -> int | None:
        return next_level(TRACK, answers) if fold else int(choices(TRACK, weights)[0])

    times: tuple[list[float], list[float]] = ([], [])
    for peer in theirs:
        times[0].append(_taken(ours, OURS_EACH))
        times[1].append(_taken(lambda peer=peer: told(peer), 1))  # type: ignore[misc]
    benchmark.pedantic(ours, rounds=1)
    work = f"QUEST+: the next of {LEVELS} levels, 820 parameter sets"
    work += f", from {len(answers)} answers" if fold else ""
    assert compare(benchmark, work, "questplus 2023.1", *times, "the same level") < 1
    if not fold:
        assert told(_theirs()) == ours()


def test_a_choice(benchmark: BenchmarkFixture) -> None:
    _compared(benchmark, [], fold=False)


def test_a_fold_of_120_answers(benchmark: BenchmarkFixture) -> None:
    random = Random(1)
    answers = [Answer(random.randrange(10, LEVELS), random.random() < 0.8) for _ in range(120)]
    _compared(benchmark, answers, fold=True)
