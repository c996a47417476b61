"""A claim of the paper, its check, and the verdict."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from device.friction.laws import LAWS


class Verdict(StrEnum):
    """The verdict of a check."""

    HOLDS = "holds"
    PARTLY = "partly"
    FAILS = "fails"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Which parts of a claim are true (None: not decidable), and the computed numbers."""

    parts: tuple[bool | None, ...]
    computed: Mapping[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """Holds if every part is true, fails if no decidable part is, else partly."""
        decided = [part for part in self.parts if part is not None]
        if not decided:
            return Verdict.NOT_TESTABLE
        if all(decided) and len(decided) == len(self.parts):
            return Verdict.HOLDS
        return Verdict.PARTLY if any(decided) else Verdict.FAILS


LawCheck = Callable[[str], Finding]
LawlessCheck = Callable[[], Finding]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of the paper.

    Attributes:
        id: short name.
        place: place in the paper.
        claim: the statement.
        check: what is computed, and the criterion.
        expected: the value or relation that the paper gives.
        find: the check itself, given the name of a law.
        lawless: whether the check is independent of the friction law.
        remark: a note on the result.
    """

    id: str
    place: str
    claim: str
    check: str
    expected: str
    find: LawCheck
    lawless: bool
    remark: str = ""


class Claims(list[Claim]):
    """Claims in the order of the paper; the methods decorate the functions that check them."""

    def under_each_law(self, **texts: str) -> Callable[[LawCheck], LawCheck]:
        """Add the claim with these texts, checked under each friction law."""

        def added(check: LawCheck) -> LawCheck:
            self.append(Claim(find=check, lawless=False, **texts))
            return check

        return added

    def without_law(self, **texts: str) -> Callable[[LawlessCheck], LawlessCheck]:
        """Add the claim with these texts, whose check is independent of the friction law."""

        def added(check: LawlessCheck) -> LawlessCheck:
            self.append(Claim(find=lambda _law: check(), lawless=True, **texts))
            return check

        return added


@dataclass(frozen=True, kw_only=True)
class Audited:
    """A claim with its finding under each law."""

    claim: Claim
    findings: Mapping[str, Finding]

    def record(self) -> dict[str, Any]:
        """Return the claim as a JSON record, an interface of `touchbeam claims --json`."""
        claim, findings = self.claim, self.findings
        numbers = {law: finding.computed for law, finding in findings.items()}
        return {
            "id": claim.id,
            "place": claim.place,
            "claim": claim.claim,
            "check": claim.check,
            "expected": claim.expected,
            "laws": {law: finding.verdict.value for law, finding in findings.items()},
            "computed": _plain(next(iter(numbers.values())) if claim.lawless else numbers),
            "remark": claim.remark,
        }


def _plain(value: Any) -> Any:
    """Return the value as JSON types, with None for a number that is not finite."""
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def audited(claim: Claim) -> Audited:
    """Check a claim under every law, or once if its check is independent of the law."""
    if claim.lawless:
        return Audited(claim=claim, findings=dict.fromkeys(LAWS, claim.find("")))
    return Audited(claim=claim, findings={law: claim.find(law) for law in LAWS})
