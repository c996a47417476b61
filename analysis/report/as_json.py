"""Conversion of results to JSON.

A number that could not be estimated is `null`, with a `reason` beside it. The reason is called
`<name>_reason` where only one of several numbers is missing.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from analysis.estimates import NotEstimable
from analysis.statistics.omnibus import SkillingsMack
from analysis.statistics.signed_rank import PairwiseTest
from analysis.statistics.summary import Reading

Json = dict[str, Any]


def plain(value: object) -> Any:
    """Return records, arrays and mappings as JSON values; NaN becomes `null`."""
    if isinstance(value, NotEstimable):
        return {"reason": value.reason}
    if is_dataclass(value):
        return {entry.name: plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and math.isnan(value) else value


def or_null(value: object) -> Any:
    """Return a value as JSON, or `None` if it could not be estimated."""
    return None if isinstance(value, NotEstimable) else plain(value)


def why(name: str, found: object) -> Json:
    """Return the reason why `name` is `null`, or nothing if `found` was estimated."""
    return {f"{name}_reason": found.reason} if isinstance(found, NotEstimable) else {}


def friedman_json(reading: Reading) -> Json:
    """Return Friedman's test, or `null` and the Skillings–Mack test if scores are missing."""
    test = reading.friedman
    if isinstance(test, NotEstimable):
        return {
            **dict.fromkeys(("chi2", "df", "p", "p_exact")),
            "reason": test.reason,
            "skillings_mack": skillings_mack_json(reading.skillings_mack),
        }
    return {
        "chi2": test.chi2,
        "df": test.df,
        "p": test.p,
        "p_exact": or_null(test.p_exact),
        **why("p_exact", test.p_exact),
    }


def skillings_mack_json(test: SkillingsMack | NotEstimable | None) -> Json | None:
    """Return the Skillings–Mack test, or `None` if no score is missing."""
    if isinstance(test, NotEstimable):
        return {**dict.fromkeys(("statistic", "df", "p")), "reason": test.reason}
    return None if test is None else dict(plain(test))


def pair_json(pair: PairwiseTest) -> Json:
    """Return the signed-rank test of a pair of conditions."""
    names = {"a": pair.a, "b": pair.b}
    if isinstance(pair.test, NotEstimable):
        nothing = dict.fromkeys(
            ("statistic", "n", "n_zero", "p", "method", "rank_biserial", "p_holm")
        )
        return {**names, **nothing, "reason": pair.test.reason}
    return {**names, **plain(pair.test), "p_holm": or_null(pair.p_holm)}
