"""Williams designs: orders of conditions in which each follows each other equally often."""


def williams_sequences(n: int) -> tuple[tuple[int, ...], ...]:
    """Return the sequences of a Williams design for `n` conditions, numbered from 0.

    There are `n` sequences for even `n` and `2 n` for odd `n`; over all of them every condition
    stands at every position, and directly after every other one, equally often.

    Source: E. J. Williams, Experimental designs balanced for the estimation of residual effects
    of treatments, Australian Journal of Scientific Research A 2 (1949) 149-168.

    >>> williams_sequences(4)
    ((0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1))

    Raises:
        ValueError: `n` is below 1.
    """
    if n < 1:
        raise ValueError(f"a design needs at least 1 condition, got {n}")
    first = _zigzag(n)
    square = tuple(tuple((start + row) % n for start in first) for row in range(n))
    if n % 2 == 0 or n == 1:
        return square
    return square + tuple(sequence[::-1] for sequence in square)


def _zigzag(n: int) -> tuple[int, ...]:
    """0, 1, n-1, 2, n-2, …: the differences of neighbours are all distinct."""
    low_and_high = ((step + 1) // 2 if step % 2 else (n - step // 2) % n for step in range(n))
    return tuple(low_and_high)
