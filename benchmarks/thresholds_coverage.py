"""How often the 95% interval of a threshold holds the truth, of people whom no prior describes.

`python -m benchmarks.thresholds_coverage` prints the table of docs/mathematics/thresholds.md, of
200 people in each cell; seeds are fixed here. A threshold that is said to lie beyond the levels
misses the truth, which lies in the middle 80% of them, in ratios.
"""

import argparse
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from analysis.estimates import FloatArray
from analysis.thresholds.psychometric import Threshold, fitted
from device.tracks.expected import counted_answers
from device.tracks.posterior import correct_share
from protocol.study.track import Track

SEED, PEOPLE = 61, 200
INNER = (0.1, 0.9)
FALSE_ALARMS = (0.0, 0.1)
GRID = {"from": 4, "to": 160, "count": 41}
FEW = {"from": 8, "to": 160, "count": 8}
DESIGNS: Final[dict[str, dict[str, Any]]] = {
    "8 levels, 15 answers each": {"method": "constant", "trials": 120, "levels": FEW},
    "8 levels, 60 answers each": {"method": "constant", "trials": 480, "levels": FEW},
    "yes or no, 8 levels of 15": {
        "method": "constant",
        "trials": 120,
        "levels": FEW,
        "task": "yes or no",
    },
    "QUEST+, 60 answers": {"method": "quest+", "trials": 60},
    "3 down 1 up, 80 answers": {
        "method": "staircase",
        "trials": 80,
        "rule": "3 down 1 up",
        "step_levels": [4, 1],
    },
}


class World(NamedTuple):
    """People: their scatter, the exponent of their Weibull curve, and their lapse rate."""

    scatter: float = 0.0
    slope: float = 3.0
    lapse: float = 0.02


WORLDS: Final = {
    "usual: slope 3, lapses .02": World(),
    "scatter .1": World(scatter=0.1),
    "scatter .2": World(scatter=0.2),
    "slope 1": World(slope=1),
    "slope 2": World(slope=2),
    "slope 5": World(slope=5),
    "slope 8": World(slope=8),
    "no lapses": World(lapse=0),
    "lapses .05": World(lapse=0.05),
    "lapses .1": World(lapse=0.1),
    "lapses .15": World(lapse=0.15),
    "slope 1, scatter .2, lapses .15": World(0.2, 1, 0.15),
    "slope 8, scatter .2, lapses .15": World(0.2, 8, 0.15),
}


def track_by(design: Mapping[str, Any]) -> Track:
    """Return the track of a design."""
    usual = {
        "name": "coverage",
        "task": "two intervals",
        "axis": "voltage",
        "levels": GRID,
        "standard": {"place": "smooth", "voltage_v": 0},
        "comparison": {"place": "smooth"},
    }
    return Track.model_validate({**usual, **design})


def fits(
    track: Track, world: World, people: int, rng: np.random.Generator
) -> tuple[FloatArray, list[Threshold]]:
    """Return true thresholds and the fits of people's answers."""
    levels = np.array(track.distances)
    ends = np.log(levels[[0, -1]])
    truth = np.exp(ends[0] + rng.uniform(*INNER, people) * np.ptp(ends))
    alarms = rng.uniform(*FALSE_ALARMS, people)
    parameters = (truth, np.array(world.slope), np.array(world.lapse), alarms)
    right = correct_share(track, levels[:, None], *parameters)
    if world.scatter:
        size = 1 / world.scatter**2 - 1
        right = rng.beta(size * right + 1e-12, size * (1 - right) + 1e-12)
    counted = counted_answers(track, right, rng.random((track.trials, people)))
    span = (float(levels[0]), float(levels[-1]))
    return truth, [
        fitted(levels, of.sum(axis=0), of[1], task=track.task, span=span) for of in counted
    ]


def cell(design: str, world: str, people: int) -> str:
    """Return the coverage of a design in a world, and how long intervals are."""
    rng = np.random.default_rng([SEED, [*DESIGNS].index(design), [*WORLDS].index(world)])
    truth, found = fits(track_by(DESIGNS[design]), WORLDS[world], people, rng)
    low, high = np.array([fit.threshold_ci for fit in found]).T
    covered = float(((low <= truth) & (truth <= high)).mean())
    told = float(np.isfinite(low).mean())
    length_db = 20 * np.log10(np.nanmedian(high / low))
    beyond = f", {1 - told:.2f} beyond" if told < 1 else ""
    return f"{covered:.3f} ({length_db:.1f} dB{beyond})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("designs", nargs="*", help=", ".join(DESIGNS))
    parser.add_argument("--people", type=int, default=PEOPLE)
    options = parser.parse_args()
    designs = options.designs or [*DESIGNS]
    print(f"| people | {' | '.join(designs)} |")
    print("|---" * (len(designs) + 1) + "|")
    for world in WORLDS:
        cells = (cell(design, world, options.people) for design in designs)
        print(f"| {world} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
