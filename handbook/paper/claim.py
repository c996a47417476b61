"""A claim of the paper and its verdict under each friction law."""

import json
from collections.abc import Callable, Iterable, Mapping
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
class Outcome:
    """What is true of a claim (None: open), and the computed numbers.

    `scope` says whether the main statement is true, in each part of its scope; `details` whether
    the rest of the claim is.
    """

    scope: tuple[bool | None, ...]
    details: tuple[bool | None, ...] = ()
    computed: Mapping[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """Fails where the main statement is nowhere true; holds where everything is true."""
        decided = [part for part in self.scope if part is not None]
        if not decided:
            return Verdict.NOT_TESTABLE
        # None is open and counts as not shown.
        if all((*self.scope, *self.details)):
            return Verdict.HOLDS
        return Verdict.PARTLY if any(decided) else Verdict.FAILS


def judged(main: Any, *details: Any, **computed: Any) -> Outcome:
    """Return the outcome on a main statement, whole or by parts of its scope, and on details."""
    scope = tuple(main) if isinstance(main, Iterable) else (main,)
    return Outcome(scope=scope, details=details, computed=computed)


def near(target: float, tolerance: float, **values: float) -> Outcome:
    """Return whether each of the values lies within `tolerance` of the target."""
    return judged([abs(value - target) < tolerance for value in values.values()], **values)


@dataclass(frozen=True)
class Claim:
    """A claim of the paper.

    `place` is where it stands, `expected` the value or relation that the paper gives. `check` says
    in words what `outcome` computes, and its criterion. `outcome` takes the name of a law, or
    nothing if no law plays a role. A `remark` says what the verdict assumes.
    """

    id: str
    place: str
    claim: str
    expected: str
    check: str
    outcome: Callable[..., Outcome]
    remark: str = ""

    def record(self) -> dict[str, Any]:
        """Return the claim with its verdicts, as docs/paper/claims.json has it."""
        by_law = bool(signature(self.outcome).parameters)
        # A check without a law is computed once, as many solve the beam.
        outcomes = (
            {law: self.outcome(law) for law in LAWS}
            if by_law
            else dict.fromkeys(LAWS, self.outcome())
        )
        computed = {law: _rounded(found.computed) for law, found in outcomes.items()}
        texts = {key: getattr(self, key) for key in ("id", "place", "claim", "check", "expected")}
        return {
            **texts,
            "laws": {law: found.verdict.value for law, found in outcomes.items()},
            "computed": computed if by_law else next(iter(computed.values())),
            "remark": self.remark,
        }


def _rounded(value: Any) -> Any:
    """Return what can be JSON with its numbers to six digits: the last may differ by computer."""
    return json.loads(
        json.dumps(plain(value)), parse_float=lambda text: float(f"{float(text):.6g}")
    )
