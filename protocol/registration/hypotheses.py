"""The hypotheses that a registration can name, each with the test that decides on it."""

from collections.abc import Iterable
from itertools import permutations

from protocol.errors import BadInput

OMNIBUS = "conditions differ"
GAINS = "gains differ"
FOLLOWS = "ratings follow the prediction"
ORDER = "order of conditions as predicted"
"""Names of the hypotheses that every study has, beside one for each ordered pair of conditions."""


def above(higher: str, lower: str) -> str:
    """Return the name of the hypothesis that one condition is rated above another."""
    return f"{higher} above {lower}"


def hypotheses(conditions: Iterable[str]) -> dict[str, str]:
    """Return the test of each hypothesis of a study with these conditions, by name.

    >>> list(hypotheses(["a", "b"]))[1:3]
    ['a above b', 'b above a']
    """
    pairs = permutations(conditions, 2)
    return {
        OMNIBUS: "Friedman's test, or the Skillings–Mack test where scores are missing; p < .05",
        **{
            above(higher, lower): "Wilcoxon's signed-rank test, two-sided, corrected by Holm's "
            "method over all pairs of conditions; p < .05 and a mean difference above 0"
            for higher, lower in pairs
        },
        # These words stand in registered texts, which are compared: another p of F leaves them.
        GAINS: "F test of the participants' slopes on the conditions' effects (Mandel); p < .05",
        FOLLOWS: "gain of the ordinal mixed model M2; its 95 % interval lies above 0",
        ORDER: "Spearman's correlation of predicted contrasts and mean ratings of the conditions; "
        "p < .05 and a correlation above 0",
    }


def require_known(name: str, known: Iterable[str]) -> None:
    """Refuse the name of a hypothesis that the study does not have.

    Raises:
        BadInput: the message lists the names that it has.
    """
    names = list(known)
    if name not in names:
        raise BadInput(f"no hypothesis {name!r}; there are {', '.join(map(repr, names))}")
