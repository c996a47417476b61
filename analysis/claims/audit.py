"""The audit: every claim with its verdicts, as a table for a terminal and as JSON."""

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
    """Every claim of the paper, checked now under every law."""
    return tuple(audited(claim) for claim in CLAIMS)


def claims_json(results: tuple[Audited, ...]) -> list[dict[str, Any]]:
    """The audit as records: id, place, claim, check, expected, laws, computed, remark."""
    return [result.record() for result in results]


def claims_lines(results: tuple[Audited, ...]) -> list[list[str]]:
    """Header, a row per claim with a verdict per law, and how many hold."""
    header = ["id", "place", *LAWS]
    held = [sum(r.findings[law].verdict is Verdict.HOLDS for r in results) for law in LAWS]
    last = [f"{len(results)} claims", "", *(f"{count} hold" for count in held)]
    return [header, *(_line(result) for result in results), last]


def _line(result: Audited) -> list[str]:
    verdicts = [result.findings[law].verdict.value for law in LAWS]
    return [result.claim.id, result.claim.place, *verdicts]
