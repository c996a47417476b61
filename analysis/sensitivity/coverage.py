"""How often the model's intervals held the truth of virtual people, in studies like this one.

`python -m benchmarks.answers --write` makes `coverage.json`, which docs/mathematics/answers.md has
as a table.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True, kw_only=True)
class SimulatedStudies:
    """Simulated studies of one kind of people.

    `people` and `trials` are how many there were, and rated trials of each; `noticed` is the share
    of changes answered as expected, `highest` that of the scores that were the highest. `held` has
    by what was estimated the share of 95% intervals that held the truth, and `too_few` what they
    held less often than chance explains in so many `studies`. They were `absolute` where scores
    were given without a question about a change.
    """

    name: str
    studies: int
    people: float
    trials: float
    noticed: float
    highest: float
    held: Mapping[str, float]
    too_few: tuple[str, ...]
    observable: bool
    absolute: bool = False

    @property
    def scale(self) -> str:
        """The scale of the scores, as docs/mathematics/answers.md has it of each kind."""
        return "1 to 7" if self.absolute else "0 to 10"

    def distance(self, people: float, trials: float, noticed: float, highest: float) -> float:
        """Return how unlike a study is: a factor of two counts as much as a fifth of a share."""
        factors = (people / self.people, trials / self.trials)
        shares = (noticed - self.noticed, highest - self.highest)
        return math.hypot(*map(math.log2, factors), *(5 * share for share in shares))


@cache
def simulated_studies() -> tuple[SimulatedStudies, ...]:
    """Return all that were simulated."""
    text = (files("analysis.sensitivity") / "coverage.json").read_text(encoding="utf-8")
    return tuple(
        SimulatedStudies(**{**row, "too_few": tuple(row["too_few"])}) for row in json.loads(text)
    )


def most_alike(
    people: int, trials: float, noticed: float, highest: float, *, absolute: bool = False
) -> SimulatedStudies:
    """Return the simulated studies that are most like one with these numbers.

    Only those count that a study can be seen to be like: how people differ in what they feel or
    how they score is not known of them.
    """
    known = [of for of in simulated_studies() if of.observable and of.absolute == absolute]
    return min(known, key=lambda of: of.distance(people, trials, noticed, highest))
