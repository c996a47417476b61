"""Number formats and sentences shared by the sections of the report."""

import math
import re

from analysis.estimates import Interval, NotEstimable
from analysis.loading.records import Exclusion
from analysis.statistics.omnibus import Friedman, MonteCarlo
from analysis.statistics.summary import ConditionTests
from analysis.trials.law_comparison import LawOrder
from analysis.trials.trial_checks import Proportion
from protocol.errors import listed

MISSING = "–"
UNBOUNDED = "unbounded"
SKIN_IN_SHORT = "Without measured friction, a gain mixes skin with perception."
SKIN = (
    f"{SKIN_IN_SHORT} The same vibration lowers the friction of a humid finger less than that of a "
    "dry one, so people with different skin differ in gain although they perceive alike."
)
MEASURED = (
    "Friction was measured at the finger in every recorded touch, so gains are to what was felt: "
    "skin is not in them. The sensor's gain cancels in a contrast."
)


def with_minus(text: str) -> str:
    """Return a text whose negative numbers have the sign that stands before all of the page.

    >>> with_minus("-5 to 5 (-5: much, 1-3: some)")
    '−5 to 5 (−5: much, 1-3: some)'
    """
    return _NEGATIVE.sub("\N{MINUS SIGN}", text)


_NEGATIVE = re.compile(r"(?<![\w.])-(?=\d)")


def number(value: float | NotEstimable | None, digits: int = 3) -> str:
    """Return a number to `digits` decimals, or a dash if it is missing.

    >>> number(-0.25, 2), number(float("nan"))
    ('−0.25', '–')
    """
    if value is None or isinstance(value, NotEstimable) or math.isnan(value):
        return MISSING
    text = f"{value:.{digits}f}"
    # A number that rounds to zero has no sign.
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def p_value(p: float | NotEstimable | None) -> str:
    """Return a p-value as journals print it; `report.json` has all its digits.

    >>> p_value(0.00390625), p_value(2.71e-5), p_value(1.0)
    ('.004', '< .001', '> .999')
    """
    if p is None or isinstance(p, NotEstimable):
        return MISSING
    # A printed 0 or 1 would claim certainty.
    if not 0.001 <= p < 0.9995:
        return "< .001" if p < 0.001 else "> .999"
    # APA: no zero before the point of a number that cannot exceed 1.
    return f"{p:.3f}".removeprefix("0")


def p_equals(p: float | NotEstimable | None) -> str:
    r"""Return the same in a sentence.

    >>> p_equals(0.00390625), p_equals(2.71e-5)
    ('p\xa0=\xa0.004', 'p\xa0<\xa0.001')
    """
    text = p_value(p)
    return unbroken(f"p {text}" if text[0] in "<>" else f"p = {text}")


def unbroken(equation: str) -> str:
    """Return a sign with its number so that no line breaks between them."""
    return equation.replace(" ", "\N{NO-BREAK SPACE}")


def bounded(value: float | NotEstimable | None, digits: int = 2) -> str:
    """Return a number that cannot exceed 1 in size, without the zero before its point.

    >>> bounded(0.48), bounded(-0.3), bounded(1.0)
    ('.48', '−.30', '1.00')
    """
    text = number(value, digits)
    return text.replace("0.", ".", 1) if text.lstrip("−").startswith("0.") else text


def chance(value: float) -> str:
    r"""Return a probability; one that two digits cannot tell from 0 or 1 is bounded.

    >>> chance(0.48), chance(0.002), chance(0.9999)
    ('P\xa0=\xa0.48', 'P\xa0<\xa0.01', 'P\xa0>\xa0.99')
    """
    if round(value, 2) in (0.0, 1.0):
        return unbroken("P < .01" if value < 0.5 else "P > .99")
    return unbroken(f"P = {bounded(value)}")


_bounded = bounded
_SMALL = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def count_of(count: int, what: str) -> str:
    """Return a number of things, in words below ten.

    >>> count_of(9, "participant"), count_of(1, "pair"), count_of(12, "trial")
    ('nine participants', 'one pair', '12 trials')
    """
    size = _SMALL[count] if count < len(_SMALL) else f"{count:,}"
    return f"{size} {what}" if count == 1 else f"{size} {what}s"


def sentence(text: str) -> str:
    """Return `text` with a capital first, and all other letters as they are.

    >>> sentence(f"{count_of(7, 'pair')} differed from P2's.")
    "Seven pairs differed from P2's."
    """
    return text[:1].upper() + text[1:]


def interval(
    ends: Interval | NotEstimable | None, digits: int = 2, *, bounded: bool = False
) -> str:
    """Return an interval that a line break cannot split; `bounded` ends cannot exceed 1."""
    # One end without the other says nothing.
    if ends is None or isinstance(ends, NotEstimable) or any(map(math.isnan, ends)):
        return MISSING
    written = _bounded if bounded else number
    low, high = (written(end, digits) if end < math.inf else UNBOUNDED for end in ends)
    return f"[{low},\N{NO-BREAK SPACE}{high}]"


def beside(ends: Interval | NotEstimable, digits: int = 2) -> str:
    """Return an interval after the number that it belongs to, or nothing if there is none."""
    return "" if isinstance(ends, NotEstimable) else f" {interval(ends, digits)}"


def _monte_carlo(found: MonteCarlo | None) -> str:
    if found is None:
        return "of chi-square, which is accurate in a table of this size"
    return (
        f"permutation {p_equals(found.p)} (Monte Carlo standard error {found.error:.1g}) from "
        f"{found.shuffles:,} shufflings within subjects"
    )


def _friedman_line(test: Friedman | NotEstimable) -> str:
    if isinstance(test, NotEstimable):
        return f"Friedman's test could not be computed: {test.reason}."
    exact = (
        _monte_carlo(test.monte_carlo)
        if isinstance(test.p_exact, NotEstimable)
        else f"exact permutation {p_equals(test.p_exact)}"
    )
    ends = test.kendall_w_interval
    w = beside(ends) if not isinstance(ends, NotEstimable) else f" (no interval: {ends.reason})"
    return (
        f"Friedman's test of equal conditions: χ²({test.df}) = {test.chi2:.4f}, "
        f"{p_equals(test.p)} ({exact}); Kendall's W = {test.kendall_w:.3f}"
        f"{w}, corrected for ties."
    )


def omnibus_line(tests: ConditionTests) -> str:
    """Return Friedman's test, or the Skillings–Mack test if cells are empty, in one sentence."""
    test = tests.skillings_mack
    if test is None:
        return _friedman_line(tests.friedman)
    if isinstance(test, NotEstimable):
        return f"No omnibus test could be computed: {test.reason}."
    omitted = "; omitted, since empty: " + listed(test.left_out) if test.left_out else ""
    return (
        "Skillings–Mack test of equal conditions (in place of Friedman's test, because cells are "
        f"empty{omitted}): T({test.df}) = {test.statistic:.4f}, {p_equals(test.p)}; "
        f"{_monte_carlo(test.monte_carlo)}."
    )


def share(found: Proportion) -> str:
    """Return a proportion with its counts, and its interval if it has one."""
    known = () if isinstance(found.interval, NotEstimable) else found.interval
    ends = ",\N{NO-BREAK SPACE}".join(f"{end:.0%}" for end in known)
    return f"{found.count} of {found.trials} ({found.share:.0%}{ends and f', [{ends}]'})"


def place_of(entry: Exclusion) -> str:
    """Return the participant, and the session or trial if only that was left out."""
    parts = {"session": entry.session, "trial": entry.trial}
    known = (f"{name} {number}" for name, number in parts.items() if number is not None)
    return ", ".join([entry.participant, *known])


def of_all(shown: int, of: int, what: str) -> str:
    """Return a sentence on how much is drawn, or an empty text if everything is."""
    return f" {shown} of {of} {what} are drawn, evenly spaced." if shown < of else ""


def ranking(order: LawOrder | NotEstimable) -> str:
    """Return the order of the conditions, the strongest first."""
    if isinstance(order, NotEstimable):
        return f"not estimable: {order.reason}"
    return " > ".join(" = ".join(group) for group in order.tied)
