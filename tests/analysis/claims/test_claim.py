"""Verdicts: what makes a claim hold, hold in part, or fail."""

from typing import Any

import pytest

from analysis.claims.claim import Outcome, PaperClaim, audited, human_outcome, near, outcome


def verdict(main: object, *details: object) -> str:
    return outcome(main, *details).verdict.value


def test_a_claim_holds_if_all_of_it_is_true() -> None:
    assert verdict(True) == "holds"
    assert verdict([True, True], True) == "holds"


@pytest.mark.parametrize("details", [(), (True,), (True, True, True)])
def test_a_claim_fails_where_its_main_statement_is_contradicted_whatever_else_is_right(
    details: tuple[bool, ...],
) -> None:
    assert verdict(False, *details) == "fails"
    assert verdict([False, False], *details) == "fails"
    assert verdict([False, None], *details) == "fails"


def test_a_claim_holds_in_part_if_its_main_statement_does() -> None:
    assert verdict([True, False]) == "partly"
    assert verdict([True, None]) == "partly"
    assert verdict(True, False) == "partly"
    assert verdict(True, None) == "partly"


@pytest.mark.parametrize("main", [None, [None, None], []])
def test_a_claim_is_not_testable_if_its_main_statement_is_not(main: object) -> None:
    assert verdict(main) == "not testable"
    assert verdict(main, True) == "not testable"


def test_near_judges_each_value() -> None:
    assert near(1.0, 0.1, a=1.05, b=1.2).scope == (True, False)


def _claim(check: object) -> PaperClaim:
    find: Any = check
    return PaperClaim(id="x", place="Eq 1", claim="it is so", check="", expected="", find=find)


def test_a_law_free_claim_is_marked_and_checked_once() -> None:
    calls = []

    def check() -> Outcome:
        calls.append(1)
        return outcome(True, number=2.0)

    record = audited(_claim(check)).record()
    assert record["law_free"] is True
    assert record["computed"] == {"number": 2.0}
    assert set(record["laws"].values()) == {"holds"}
    assert len(calls) == 1


def test_the_sentence_carries_the_uncertainty_of_human_data() -> None:
    def check(law: str) -> Outcome:
        return human_outcome("p .039", law == "coulomb", rate=1)

    record = audited(_claim(check)).record()
    assert record["sentence"] == "it is so [p .039]"
    assert record["claim"] == "it is so"
    assert record["law_free"] is False
    assert record["laws"] == {"printed": "fails", "consistent": "fails", "coulomb": "holds"}
