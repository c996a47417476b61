"""How the report writes numbers, and the sentences that stand between its tables."""

import math
from collections.abc import Sequence

from analysis.estimates import Interval, NotEstimable
from analysis.sensitivity.checks import Discrimination, Drift, FTest, Proportion
from analysis.statistics.omnibus import Friedman
from analysis.statistics.summary import Reading

MISSING = "–"


def number(value: float | NotEstimable | None, digits: int = 3) -> str:
    """Return a number to so many decimals, and a dash where there is none.

    >>> number(-0.25, 2), number(float("nan"))
    ('−0.25', '–')
    """
    if value is None or isinstance(value, NotEstimable) or math.isnan(value):
        return MISSING
    text = f"{value:.{digits}f}"
    # What rounds to nothing has no sign.
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def p_value(p: float | NotEstimable | None) -> str:
    """Return a p-value to three significant digits.

    >>> p_value(0.00390625), p_value(2.71e-5)
    ('.00391', '2.71e-05')
    """
    if p is None or isinstance(p, NotEstimable):
        return MISSING
    if p >= 0.9995:
        return "1"
    text = f"{p:.3g}"
    return text if "e" in text else text.removeprefix("0")


def interval(ends: Interval, digits: int = 2) -> str:
    """Return an interval that no line break divides."""
    return f"[{number(ends[0], digits)},\N{NO-BREAK SPACE}{number(ends[1], digits)}]"


def friedman_line(test: Friedman | NotEstimable) -> str:
    """Return the omnibus test in one sentence."""
    if isinstance(test, NotEstimable):
        return f"Friedman's test: none ({test.reason})."
    exact = (
        f"no exact p: {test.p_exact.reason}"
        if isinstance(test.p_exact, NotEstimable)
        else f"exact permutation p = {test.p_exact:.4g}"
    )
    return (
        f"Friedman's test of equal conditions: χ²({test.df}) = {test.chi2:.4f}, "
        f"p = {test.p:.4g} ({exact}); Kendall's W = {test.kendall_w:.3f}, corrected for ties."
    )


def omnibus_line(reading: Reading) -> str:
    """Return the omnibus test that fits: Skillings and Mack's where scores are missing."""
    test = reading.skillings_mack
    if test is None:
        return friedman_line(reading.friedman)
    if isinstance(test, NotEstimable):
        return f"No omnibus test: {test.reason}."
    return (
        f"Scores are missing, so that Friedman's test does not apply; Skillings and Mack's test of "
        f"equal conditions{_without(test.left_out)}: T({test.df}) = {test.statistic:.4f}, "
        f"p = {test.p:.4g}."
    )


def _without(conditions: Sequence[str]) -> str:
    return f", without {', '.join(conditions)}, which nobody scored" if conditions else ""


def drift_line(found: Drift | NotEstimable) -> str:
    """Return the drift within a session in one sentence."""
    if isinstance(found, NotEstimable):
        return f"Drift: not told ({found.reason})."
    return (
        f"Drift: {number(found.points_per_trial)} points per trial, 95 % interval "
        f"{interval(found.interval, 3)}, p = {p_value(found.p)}."
    )


def f_line(name: str, found: FTest | NotEstimable) -> str:
    """Return an F test in one sentence."""
    if isinstance(found, NotEstimable):
        return f"{name}: not told ({found.reason})."
    return f"{name}: F({found.df[0]}, {found.df[1]}) = {found.f:.3f}, p = {p_value(found.p)}."


def share(found: Proportion) -> str:
    """Return a share with its counts, and with its interval if it has one."""
    ends = "" if isinstance(found.interval, NotEstimable) else f", {interval(found.interval)}"
    return f"{found.count} of {found.trials} ({found.share:.0%}{ends})"


def catch_line(found: Discrimination | NotEstimable) -> str:
    """Return hits and false alarms in one sentence."""
    if isinstance(found, NotEstimable):
        return f"Catch trials: nothing to tell ({found.reason})."
    return (
        f"Catch trials (0 V): a change, whichever it was, was reported on "
        f"{share(found.false_alarms)} of them, and on {share(found.hits)} of the scored trials; "
        f"d′ = {number(found.d_prime, 2)}, criterion {number(found.criterion, 2)}{_pooled(found)}."
    )


def _pooled(found: Discrimination) -> str:
    unknown = found.hits.interval
    return f" (no intervals: {unknown.reason})" if isinstance(unknown, NotEstimable) else ""
