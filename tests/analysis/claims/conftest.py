"""The outcomes of single claims, by name."""

from collections.abc import Callable

import pytest

from analysis.claims.audit import CLAIMS
from analysis.claims.claim import Audited, Outcome, audited

Find = Callable[..., Outcome]


@pytest.fixture
def find() -> Find:
    """Return the outcome of the claim of a name, under a law if it depends on one."""
    claims = {claim.id: claim for claim in CLAIMS}
    return lambda name, *law: claims[name].find(*law)


@pytest.fixture(scope="session")
def results() -> tuple[Audited, ...]:
    """Return the audit of all claims."""
    return tuple(audited(claim) for claim in CLAIMS)
