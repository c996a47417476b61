"""What is kept is found again; what cannot be kept is made each time."""

from collections.abc import Callable
from functools import partial

from analysis.kept import Kept

_made: list[float] = []


def twice(number: float) -> float:
    _made.append(number)
    return 2 * number


def applied(function: Callable[[float], float], number: float) -> float:
    return function(number)


def test_what_was_made_ahead_is_not_made_again_and_a_closure_is_left_for_later() -> None:
    keep, factor = Kept(), 3.0
    closure = partial(applied, lambda number: factor * number, 5.0)
    _made.clear()
    keep.ahead([[partial(twice, 4.0), closure]], 1)
    assert keep(twice, 4.0) == 8.0
    assert _made == [4.0]
    assert keep(applied, lambda number: factor * number, 5.0) == 15.0
