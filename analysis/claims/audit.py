"""Audit of the paper: every claim with its verdicts, as a table and as JSON."""

from typing import Any

from analysis.claims import (
    eq15_ratio,
    equations,
    fig12,
    full_coverage,
    hardware,
    human_factors,
    local_coverage,
)
from analysis.claims.claim import Audited, Claim, Verdict, audited
from device.friction.laws import LAWS

CLAIMS: tuple[Claim, ...] = (
    *equations.CLAIMS,
    *eq15_ratio.CLAIMS,
    *fig12.CLAIMS,
    *hardware.CLAIMS,
    *full_coverage.CLAIMS,
    *local_coverage.CLAIMS,
    *hardware.SLIDING_CLAIMS,
    *human_factors.TABLE4_CLAIMS,
    *human_factors.CLAIMS,
)


def audit() -> tuple[Audited, ...]:
    """Check every claim of the paper under every law."""
    return tuple(audited(claim) for claim in CLAIMS)


def claims_json(results: tuple[Audited, ...]) -> list[dict[str, Any]]:
    """Return the audit as records: id, place, claim, check, expected, laws, computed, remark."""
    return [result.record() for result in results]


def claims_lines(results: tuple[Audited, ...]) -> list[list[str]]:
    """Return a header, a row per claim with a verdict per law, and a row of totals."""
    rows = [
        [result.claim.id, result.claim.place, *(result.findings[law].verdict for law in LAWS)]
        for result in results
    ]
    held = [sum(r.findings[law].verdict is Verdict.HOLDS for r in results) for law in LAWS]
    last = [f"{len(results)} claims", "", *(f"{count} hold" for count in held)]
    return [["id", "place", *LAWS], *rows, last]
