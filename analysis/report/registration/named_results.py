"""The registered hypotheses with their results, and whether each result was registered."""

from collections.abc import Iterator
from dataclasses import dataclass

from analysis.estimates import NotEstimable
from analysis.loading.study_lock import StudyLock
from analysis.report.findings import Findings
from analysis.report.results import DIFFER, FOLLOW, ORDERED, WHICH, omnibus_p, paragraphs
from analysis.report.wording import interval, number, p_equals
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.statistics.signed_rank import LEVEL, SignedRank
from protocol.registration.registration import FOLLOWS, GAINS, OMNIBUS, ORDER, above


@dataclass(frozen=True, kw_only=True)
class NamedResult:
    """The result of a registered hypothesis.

    `supported` is None where it cannot be computed; `found` says why, or what was found. A
    secondary hypothesis is supported only if the primary one is, so that without any effect one of
    them is supported in 5% of studies at most.
    """

    name: str
    primary: bool
    found: str
    p: float | None
    supported: bool | None

    @property
    def verdict(self) -> str:
        """Return the verdict in words."""
        if self.supported is None:
            return "not known"
        return "supported" if self.supported else "not supported"


def named_results(found: Findings, lock: StudyLock) -> list[NamedResult]:
    """Return the results of the registered hypotheses, the primary one first."""
    first, *others = [_result(found, lock, name) for name in lock.registration.hypotheses]
    counted = [gated(first, other) for other in others]
    return [first, *counted]


def gated(primary: NamedResult, other: NamedResult) -> NamedResult:
    """Return the result of a secondary hypothesis, which counts only after the primary one."""
    if primary.supported or not other.supported:
        return other
    return NamedResult(
        name=other.name,
        primary=False,
        found=f"{other.found}; does not count, because the primary hypothesis is not supported",
        p=other.p,
        supported=False,
    )


def _result(found: Findings, lock: StudyLock, name: str) -> NamedResult:
    told, p, supported = _computed(found, lock, name)
    return NamedResult(
        name=name,
        primary=name == lock.registration.primary,
        found=told,
        p=p,
        supported=supported,
    )


_Computed = tuple[str, float | None, bool | None]
"""What was found, p, and whether it supports the hypothesis."""


def _computed(found: Findings, lock: StudyLock, name: str) -> _Computed:
    if name == OMNIBUS:
        return _tested(omnibus_p(found.table.main))
    if name == GAINS:
        test = found.table.heterogeneity
        return _tested(test if isinstance(test, NotEstimable) else test.p)
    if name == FOLLOWS:
        return _gain(found)
    if name == ORDER:
        return _order(found, lock.registration.law)
    return _pair(found, name)


def _tested(p: float | NotEstimable) -> _Computed:
    return _missing(p) if isinstance(p, NotEstimable) else (p_equals(p), p, p < LEVEL)


def _missing(reason: NotEstimable) -> _Computed:
    return reason.reason, None, None


def _gain(found: Findings) -> _Computed:
    fit = found.trials.m2
    if isinstance(fit, NotEstimable):
        return _missing(fit)
    assert isinstance(fit, OrdinalSensitivity)
    ends = fit.lines.gain_interval
    if not fit.lines.group_known:
        return _missing(NotEstimable("a single participant tells nothing about a group"))
    return f"gain {number(fit.lines.gain, 2)}, 95% CI {interval(ends)}", None, ends[0] > 0


def _order(found: Findings, law: str) -> _Computed:
    order = found.trials.orders.get(law)
    if order is None or isinstance(order, NotEstimable):
        return "too few conditions with a prediction", None, None
    rho, p = order.spearman, order.p
    if isinstance(rho, NotEstimable):
        return _missing(rho)
    if isinstance(p, NotEstimable):
        return _missing(p)
    return f"ρ = {number(rho, 2)}, {p_equals(p)}", p, rho > 0 and p < LEVEL


def _pair(found: Findings, name: str) -> _Computed:
    for pair in found.table.main.pairwise:
        for higher, lower, sign in ((pair.a, pair.b, 1), (pair.b, pair.a, -1)):
            if name == above(higher, lower):
                if isinstance(pair.test, NotEstimable):
                    return _missing(pair.test)
                assert isinstance(pair.test, SignedRank)
                by, p = sign * pair.test.mean_difference, pair.p_holm
                if isinstance(p, NotEstimable):
                    return _missing(p)
                told = f"mean difference {number(by, 2)}, {p_equals(p)} (Holm)"
                return told, p, by > 0 and p < LEVEL
    return "these conditions have no scores to compare", None, None


def marked(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield the results in words; those of a registered study say whether they were registered."""
    lock = found.loaded.lock
    if lock is None:
        yield from paragraphs(found)
        return
    names = lock.registration.hypotheses
    others = {OMNIBUS, GAINS, FOLLOWS, ORDER}
    asked = {
        DIFFER: [name for name in names if name == OMNIBUS],
        WHICH: [name for name in names if name not in others],
        FOLLOW: [name for name in names if name == FOLLOWS],
        ORDERED: [name for name in names if name == ORDER],
    }
    secondary = f", {', '.join(lock.registration.secondary)}" * bool(lock.registration.secondary)
    yield (
        "What was registered?",
        f"Registered: {lock.registration.primary} (primary){secondary}. Not registered: every "
        "other result on this page. Section Registration has the results of what was registered, "
        "and all deviations.",
    )
    for question, answer in paragraphs(found):
        registered = ", ".join(asked.get(question, []))
        yield (
            f"{question} ({f'registered: {registered}' if registered else 'not registered'})",
            answer,
        )
