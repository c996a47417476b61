"""Audit of the paper: every claim with its verdicts, as a table and as JSON."""

from collections import Counter

from analysis.claims import (
    coverage,
    equations,
    hardware,
    human_factors,
    published_scores,
    vibration,
)
from analysis.claims.claim import Audited, PaperClaim, Verdict, audited
from device.friction.laws import LAWS

CLAIMS: tuple[PaperClaim, ...] = (
    *vibration.CLAIMS,
    *equations.CLAIMS,
    *hardware.CLAIMS,
    *coverage.CLAIMS,
    *hardware.SLIDING_CLAIMS,
    *published_scores.CLAIMS,
    *human_factors.CLAIMS,
)
LAW_FREE = "law-free"


def audit() -> tuple[Audited, ...]:
    """Check every claim of the paper under every law."""
    return tuple(audited(claim) for claim in CLAIMS)


def counts(results: tuple[Audited, ...]) -> dict[str, Counter[Verdict]]:
    """Return how many claims have each verdict: under each law, and once if none plays a role."""
    found: dict[str, Counter[Verdict]] = {name: Counter() for name in (LAW_FREE, *LAWS)}
    for result in results:
        for name, verdict in _by_column(result).items():
            found[name][verdict] += 1
    return found


def _by_column(result: Audited) -> dict[str, Verdict]:
    if result.claim.law_free:
        # Counted once, because under each law it would weigh three times as much as others.
        return {LAW_FREE: next(iter(result.outcomes.values())).verdict}
    return {law: outcome.verdict for law, outcome in result.outcomes.items()}


def claims_lines(results: tuple[Audited, ...]) -> list[list[str]]:
    """Return a header, a row per claim, a row per verdict with its counts, and a row of totals.

    A claim that depends on no law has its verdict in the column for those alone.
    """
    columns, found = (LAW_FREE, *LAWS), counts(results)
    rows = []
    for result in results:
        claim, verdicts = result.claim, _by_column(result)
        remark = f" - {claim.remark}" if claim.remark else ""
        words = f"{claim.id} ({claim.place}): {result.sentence}{remark}"
        rows.append([words, *(verdicts.get(name, "") for name in columns)])
    totals = [
        [f"count: {verdict}", *(str(found[name][verdict]) for name in columns)]
        for verdict in Verdict
    ]
    last = [f"{len(results)} claims", *(str(found[name].total()) for name in columns)]
    return [["claim", *columns], *rows, *totals, last]


def summary_line(results: tuple[Audited, ...]) -> str:
    """Return how many claims hold, those that depend on no law counted once."""
    free, *by_law = counts(results).items()
    depending = by_law[0][1].total()
    held = ", ".join(f"{law} {counter[Verdict.HOLDS]}" for law, counter in by_law)
    return (
        f"Hold: {free[1][Verdict.HOLDS]} of {free[1].total()} {free[0]}; "
        f"of {depending} others {held}"
    )
