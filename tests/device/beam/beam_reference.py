"""The clamped-free beam in 50 digits, by the textbook formulas, for the tests of the model.

Written from the definitions and from nothing in `device`: hyperbolic mode shapes, roots and zone
edges by bisection and secant in mpmath.
"""

from functools import lru_cache

import mpmath as mp

DIGITS = 50
_TOLERANCE = mp.mpf(10) ** -100


def workdps(order: int) -> mp.workdps:
    """Enough digits for 50 true ones after the hyperbolic form's cancellation e^b."""
    return mp.workdps(DIGITS + int(1.5 * order) + 10)


@lru_cache(maxsize=128)
def root(order: int) -> mp.mpf:
    """b of cos b cosh b = -1."""
    with workdps(order):
        start = mp.mpf("1.8751") if order == 1 else (order - mp.mpf(1) / 2) * mp.pi
        return mp.findroot(lambda b: mp.cos(b) + 1 / mp.cosh(b), start)


@lru_cache(maxsize=128)
def sigma(order: int) -> mp.mpf:
    """σ of the textbook form."""
    with workdps(order):
        b = root(order)
        return (mp.sinh(b) - mp.sin(b)) / (mp.cosh(b) + mp.cos(b))


def shape(order: int, xi: mp.mpf) -> mp.mpf:
    """φ(ξ), with a positive start at the clamp."""
    with workdps(order):
        t, s = root(order) * xi, sigma(order)
        return mp.cosh(t) - mp.cos(t) - s * (mp.sinh(t) - mp.sin(t))


def slope(order: int, xi: mp.mpf) -> mp.mpf:
    """dφ/dξ."""
    with workdps(order):
        b, s = root(order), sigma(order)
        t = b * xi
        return b * (mp.sinh(t) + mp.sin(t) - s * (mp.cosh(t) - mp.cos(t)))


def integral(order: int, xi: mp.mpf) -> mp.mpf:
    """∫φ from the clamp."""
    with workdps(order):
        b, s = root(order), sigma(order)
        t = b * xi
        return (mp.sinh(t) - mp.sin(t) - s * (mp.cosh(t) + mp.cos(t) - 2)) / b


@lru_cache(maxsize=64)
def edges(order: int) -> tuple[mp.mpf, ...]:
    """0, antinode, node, antinode, …, 1: the zone edges as fractions of the length."""
    with workdps(order):
        b = root(order)
        inner = []
        for k in range(1, order):
            for function, quarter in ((slope, mp.mpf(-1) / 4), (shape, mp.mpf(1) / 4)):
                start = (k + quarter) * mp.pi / b

                def value(xi: mp.mpf, function: object = function) -> mp.mpf:
                    return function(order, xi)  # type: ignore[operator]

                inner.append(mp.findroot(value, (start, start + 1 / (100 * b)), tol=_TOLERANCE))
        return (mp.mpf(0), *inner, mp.mpf(1))


def window(order: int, length_m: float, x_m: float, contact_m: float) -> tuple[mp.mpf, mp.mpf]:
    """The right-moving part of a window and its ∫|φ|dξ, from the doubles taken exactly."""
    with workdps(order):
        length = mp.mpf(length_m)
        stop = mp.mpf(x_m) / length
        start = max(mp.mpf(0), (mp.mpf(x_m) - mp.mpf(contact_m)) / length)
        right = area = mp.mpf(0)
        for zone, (low, high) in enumerate(zip(edges(order)[:-1], edges(order)[1:], strict=True)):
            a, b = max(start, low), min(stop, high)
            if b > a:
                area += abs(integral(order, b) - integral(order, a))
                right += (b - a) * (zone % 2)
        return right / (stop - start), area
