"""Where a staircase settles: the share correct at which it moves neither way."""

from protocol.tracks.procedure import Staircase, TrackPlace


def converges_at(rule: Staircase) -> float:
    """Return the share correct at which steps down and up balance.

    The counts of correct answers and of errors are a Markov chain, whose states are left by a step
    to a harder or an easier level. At a share p of correct answers its stationary distribution
    gives how often each step is made; the share at which the mean of all steps is 0 is found by
    bisection (Levitt, J. Acoust. Soc. Am. 49, 1971, 467-477; weighted: Kaernbach, Percept.
    Psychophys. 49, 1991, 227-229). The last steps of the staircase count.

    >>> from protocol.tracks.procedure import Staircase
    >>> steps = {"down_steps": (1,), "up_steps": (1,), "one_by_one": False, "levels": 9}
    >>> round(converges_at(Staircase(down=3, up=1, cumulative=False, **steps)), 4)
    0.7937
    >>> round(converges_at(Staircase(down=3, up=1, cumulative=True, **steps)), 4)
    0.75
    """
    low, high = 0.0, 1.0
    for _ in range(24):
        middle = (low + high) / 2
        if _drift(rule, middle) > 0:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _drift(rule: Staircase, share: float) -> float:
    """Return the mean step of an answer towards easier levels, in levels of the grid."""
    chain, to_easier = _chain(rule)
    shares = dict.fromkeys(chain, 1 / len(chain))
    # Averaged with itself, because a chain that goes round in a circle would never settle.
    for _ in range(300):
        following = dict.fromkeys(chain, 0.0)
        for state, here in shares.items():
            after_right, after_wrong = chain[state]
            following[after_right] += here * share
            following[after_wrong] += here * (1 - share)
        shares = {state: (shares[state] + following[state]) / 2 for state in chain}
    return sum(
        here * (share * to_easier[state][0] + (1 - share) * to_easier[state][1])
        for state, here in shares.items()
    )


_Counts = tuple[int, int]


def _chain(
    rule: Staircase,
) -> tuple[dict[_Counts, tuple[_Counts, _Counts]], dict[_Counts, tuple[int, int]]]:
    """Return, by the counts, those after a correct answer and an error, and the steps made."""
    sizes = {-1: -rule.down_steps[-1], 0: 0, 1: rule.up_steps[-1]}
    chain: dict[_Counts, tuple[_Counts, _Counts]] = {}
    steps: dict[_Counts, tuple[int, int]] = {}
    waiting = [(0, 0)]
    while waiting:
        state = waiting.pop()
        if state in chain:
            continue
        # A reversal before, so that no beginning counts.
        here = TrackPlace(1, *state, 0, (1,))
        after = [rule.moved(here, correct) for correct in (True, False)]
        right, wrong = ((place.right, place.wrong) for place in after)
        chain[state] = right, wrong
        steps[state] = sizes[after[0].heading], sizes[after[1].heading]
        waiting += [right, wrong]
    return chain, steps
