"""A claim of the paper, its check, and the verdict."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from inspect import getdoc, signature
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
    """What is true of a claim (None: not decidable), and the computed numbers.

    `scope` tells whether the main statement is true, in each part of its scope, and `details`
    whether the rest of what the claim says is. `evidence` has the uncertainty of human data in
    words, the same under every law.
    """

    scope: tuple[bool | None, ...]
    details: tuple[bool | None, ...] = ()
    computed: Mapping[str, Any] = field(default_factory=dict)
    evidence: str = ""

    @property
    def verdict(self) -> Verdict:
        """Fails where the main statement is nowhere true, whatever else is; holds if all is true.

        It is partly true if some of its scope is, and not testable if none can be decided.
        """
        decided = [part for part in self.scope if part is not None]
        if not decided:
            return Verdict.NOT_TESTABLE
        # None is undecided and counts as not shown.
        if all((*self.scope, *self.details)):
            return Verdict.HOLDS
        return Verdict.PARTLY if any(decided) else Verdict.FAILS


def outcome(main: Any, *details: Any, **computed: Any) -> Outcome:
    """Return the outcome on a main statement, as a whole or by parts of its scope, and details."""
    scope = tuple(main) if isinstance(main, Iterable) else (main,)
    return Outcome(scope=scope, details=details, computed=computed)


def human_outcome(evidence: str, main: Any, /, *details: Any, **computed: Any) -> Outcome:
    """Return the same with the uncertainty of the human data behind it, in words."""
    return replace(outcome(main, *details, **computed), evidence=evidence)


def near(target: float, tolerance: float, **values: float) -> Outcome:
    """Return whether each of the values lies within `tolerance` of the target."""
    return outcome([abs(value - target) < tolerance for value in values.values()], **values)


Check = Callable[..., Outcome]


@dataclass(frozen=True)
class PaperClaim:
    """A claim of the paper.

    `check` says what is computed, and the criterion; `expected` is the value or relation that the
    paper gives. `find` is the check itself, which takes the name of a law unless it depends on
    none. A `remark` says what the result assumes, and how the verdict moves without.
    """

    id: str
    place: str
    claim: str
    check: str
    expected: str
    find: Check
    remark: str = ""

    @property
    def law_free(self) -> bool:
        """Whether the check is independent of the friction law."""
        return not signature(self.find).parameters


class PaperClaims(list[PaperClaim]):
    """Claims in the order of the paper."""

    def add(
        self, place: str, claim: str, expected: str, *, check: str = "", remark: str = ""
    ) -> Callable[[Check], Check]:
        """Add a claim with these texts; the decorated check gives it its name.

        Its docstring says what is computed, and the criterion, unless that needs more than a line.
        """

        def added(find: Check) -> Check:
            said = check or _within_a_sentence(getdoc(find) or "")
            # Named after its function, so that no two places have to agree.
            name = find.__name__.strip("_").replace("_", "-")
            self.append(PaperClaim(name, place, claim, said, expected, find, remark))
            return find

        return added


def _within_a_sentence(text: str) -> str:
    """Return a sentence without its capital, unless it numbers something, and its full stop.

    >>> _within_a_sentence("Minima of μ' at x below 81 mm."), _within_a_sentence("Eq 5 times 2.")
    ("minima of μ' at x below 81 mm", 'Eq 5 times 2')
    """
    first = text[:1] if text.startswith(("Eq ", "Table ")) else text[:1].lower()
    return (first + text[1:]).removesuffix(".")


@dataclass(frozen=True, kw_only=True)
class Audited:
    """A claim with its outcome under each law."""

    claim: PaperClaim
    outcomes: Mapping[str, Outcome]

    @property
    def sentence(self) -> str:
        """The claim, with the uncertainty of the human data behind it."""
        evidence = next(iter(self.outcomes.values())).evidence
        return f"{self.claim.claim} [{evidence}]" if evidence else self.claim.claim

    def record(self) -> dict[str, Any]:
        """Return the claim as a JSON record, an interface of `touchbeam claims --json`."""
        claim, outcomes = self.claim, self.outcomes
        numbers = {law: outcome.computed for law, outcome in outcomes.items()}
        return {
            **{
                name: getattr(claim, name) for name in ("id", "place", "claim", "check", "expected")
            },
            "sentence": self.sentence,
            "law_free": claim.law_free,
            "laws": {law: outcome.verdict.value for law, outcome in outcomes.items()},
            "computed": plain(next(iter(numbers.values())) if claim.law_free else numbers),
            "remark": claim.remark,
        }


def audited(claim: PaperClaim) -> Audited:
    """Check a claim under every law, or once if its check is independent of the law."""
    if claim.law_free:
        # Computed once: many checks solve the beam several times.
        return Audited(claim=claim, outcomes=dict.fromkeys(LAWS, claim.find()))
    return Audited(claim=claim, outcomes={law: claim.find(law) for law in LAWS})
