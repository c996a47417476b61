"""A claim of the paper, its check, and the verdict."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from inspect import signature
from typing import Any

from analysis.estimates import plain
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


def finding(*parts: Any, **computed: Any) -> Finding:
    """Return the finding with these parts of the claim, and these numbers by name."""
    return Finding(parts=parts, computed=computed)


Check = Callable[..., Finding]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim of the paper.

    Attributes:
        id: short name.
        place: place in the paper.
        claim: the statement.
        check: what is computed, and the criterion.
        expected: the value or relation that the paper gives.
        find: the check itself; it takes the name of a law unless it depends on none.
        remark: a note on the result.
    """

    id: str
    place: str
    claim: str
    check: str
    expected: str
    find: Check
    remark: str = ""

    @property
    def lawless(self) -> bool:
        """Whether the check is independent of the friction law."""
        return not signature(self.find).parameters


class Claims(list[Claim]):
    """Claims in the order of the paper."""

    def add(self, **texts: str) -> Callable[[Check], Check]:
        """Add a claim with these texts; the decorated check gives it its name."""

        def added(check: Check) -> Check:
            name = check.__name__.strip("_").replace("_", "-")
            self.append(Claim(id=name, find=check, **texts))
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
            **{
                name: getattr(claim, name) for name in ("id", "place", "claim", "check", "expected")
            },
            "laws": {law: finding.verdict.value for law, finding in findings.items()},
            "computed": plain(next(iter(numbers.values())) if claim.lawless else numbers),
            "remark": claim.remark,
        }


def audited(claim: Claim) -> Audited:
    """Check a claim under every law, or once if its check is independent of the law."""
    if claim.lawless:
        return Audited(claim=claim, findings=dict.fromkeys(LAWS, claim.find()))
    return Audited(claim=claim, findings={law: claim.find(law) for law in LAWS})
