"""Checks of the arrays of ratings."""

import numpy as np
import pytest

from analysis.sensitivity.lines import Ratings


def ratings(**changed: object) -> Ratings:
    fields: dict[str, object] = {
        "subjects": ("a", "b"),
        "conditions": ("voltage",),
        "subject": np.array([0, 1]),
        "condition": np.array([0, 0]),
        "contrast": np.array([0.1, 0.2]),
        "rating": np.array([3.0, np.nan]),
    }
    return Ratings(**{**fields, **changed})  # type: ignore[arg-type]


def test_given_drops_trials_without_a_rating() -> None:
    assert len(ratings().rating) == 2
    assert ratings().given.subject.tolist() == [0]
    assert ratings().given.subjects == ("a", "b")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"condition": np.array([0])}, "condition must have 2 trials, got 1"),
        ({"subject": np.array([0, 2])}, r"subject must lie in \[0, 1\], got 2"),
        ({"condition": np.array([0, -1])}, r"condition must lie in \[0, 0\], got -1"),
        ({"contrast": np.array([0.1, np.nan])}, "contrast must be finite, got nan"),
        ({"rating": np.array([0.1, np.inf])}, "rating must be finite or missing, got inf"),
    ],
)
def test_invalid_trials_are_refused(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ratings(**changed)
