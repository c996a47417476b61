"""A claim of the paper, its check, and the verdict that follows from what the check found."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from device.friction.laws import LAWS

Computed = Mapping[str, Any]


class Verdict(StrEnum):
    """What a check says of a claim."""

    HOLDS = "holds"
    PARTLY = "partly"
    FAILS = "fails"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What a check found: which of the claim's parts are true, and the numbers behind it.

    A part of None cannot be decided.
    """

    parts: tuple[bool | None, ...]
    computed: Computed = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """Holds if every decided part does, fails if none does."""
        decided = [part for part in self.parts if part is not None]
        if not decided:
            return Verdict.NOT_TESTABLE
        if all(decided) and len(decided) == len(self.parts):
            return Verdict.HOLDS
        return Verdict.PARTLY if any(decided) else Verdict.FAILS


Check = Callable[[str], Finding]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim as the paper makes it.

    Attributes:
        id: short name.
        place: where in the paper.
        claim: what is claimed.
        check: what is computed, and when the claim counts as true.
        expected: the value or relation that the paper gives.
        find: the check itself, for the law of a name.
        remark: what one should know to read the result.
        lawless: whether no friction law takes part, so that one check serves all.
    """

    id: str
    place: str
    claim: str
    check: str
    expected: str
    find: Check
    remark: str = ""
    lawless: bool = False


def without_law(check: Callable[[], Finding]) -> Check:
    """A check in which no friction law takes part."""
    return lambda _law: check()


@dataclass(frozen=True, kw_only=True)
class Audited:
    """A claim with what was found under each law."""

    claim: Claim
    findings: Mapping[str, Finding]

    def record(self) -> dict[str, Any]:
        """The JSON shape that others rely on."""
        claim, findings = self.claim, self.findings
        first = next(iter(findings.values()))
        numbers = (
            dict(first.computed)
            if claim.lawless
            else {law: dict(finding.computed) for law, finding in findings.items()}
        )
        return {
            "id": claim.id,
            "place": claim.place,
            "claim": claim.claim,
            "check": claim.check,
            "expected": claim.expected,
            "laws": {law: finding.verdict.value for law, finding in findings.items()},
            "computed": _plain(numbers),
            "remark": claim.remark,
        }


def _plain(value: Any) -> Any:
    """Numbers as JSON knows them; one that is not a number is null."""
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def audited(claim: Claim) -> Audited:
    """Make a claim's check under every law; a check without a law is made once."""
    if claim.lawless:
        finding = claim.find("")
        return Audited(claim=claim, findings=dict.fromkeys(LAWS, finding))
    return Audited(claim=claim, findings={law: claim.find(law) for law in LAWS})
