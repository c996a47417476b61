"""Fits of large studies, which processes of their own make."""

import os
from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.linear_model import linear_sensitivity
from analysis.trials.trial_statistics import made
from tests.analysis.sensitivity.people_of_other_kinds import own_people


def test_fits_to_few_trials_are_made_in_this_process() -> None:
    assert made({"who": os.getpid}, LARGE - 1) == {"who": os.getpid()}


def test_fits_to_many_trials_are_made_in_others_with_the_same_numbers() -> None:
    ratings = own_people(np.random.default_rng(1))
    m1 = partial(linear_sensitivity, ratings)
    fits: dict[str, Callable[[], object]] = {"who": os.getpid, "M1": m1}
    found = made(fits, LARGE)
    assert found.keys() == {"who", "M1"}
    assert found["who"] != os.getpid()
    assert repr(found["M1"]) == repr(linear_sensitivity(ratings))
