"""Fits of large studies, which processes of their own make."""

from functools import partial

import numpy as np

from analysis.kept import Kept
from analysis.sensitivity.linear_model import linear_sensitivity
from tests.analysis.sensitivity.people_of_other_kinds import own_people


def test_fits_that_others_made_ahead_are_taken_and_have_the_same_numbers() -> None:
    keep, ratings = Kept(), own_people(np.random.default_rng(1))
    keep.ahead([partial(linear_sensitivity, ratings)], 2)

    def never() -> None:
        raise AssertionError("it is known")

    found = keep.made(never, linear_sensitivity, (ratings,), {})
    assert repr(found) == repr(linear_sensitivity(ratings))
