"""What reports claim of simulated people in worlds where a claim is false, and what is found."""

import numpy as np
import pytest

from analysis.power.null_cohorts import kind_of
from analysis.power.power_summary import share, too_often
from analysis.power.study_records import BY_GROUP, GROUP_GAIN, GROUP_SCORE, asked_by
from benchmarks.response import (
    ALL_NOTICED,
    ALONE,
    COHORTS,
    HOW_TO,
    IN_NULLS,
    NULLS,
    STUDIES,
    WITH_ALONE,
    World,
    reports,
)
from device.people.person import DEFAULT
from protocol.registration.registration import FOLLOWS, NOTICED, OMNIBUS


def test_each_claim_is_about_one_thing() -> None:
    study, _ = STUDIES["the how-to's"]()
    asked = asked_by(study)
    kinds = {claim: kind_of(asked, claim) for claim in asked.family}
    assert kinds[OMNIBUS] == kinds["effect of voltage"] == kinds["voltage by frequency"]
    assert kinds[OMNIBUS] == kinds["50 V, 23 kHz - 50 V, 24 kHz"] == "conditions"
    assert kinds["effect of session"] == kinds["voltage by session"] == "sessions"
    assert kinds[GROUP_SCORE] == kinds["50 V, 23 kHz: young - old between groups"] == "groups"
    assert (kinds[GROUP_GAIN], kinds[BY_GROUP]) == ("gains", "profiles")
    assert kinds[NOTICED] == kinds[f"50 V, 23 kHz {NOTICED}"] == "noticed"
    assert kinds[FOLLOWS] == "slope"


def test_what_is_false_depends_on_the_world() -> None:
    asked = asked_by(STUDIES["three groups"]()[0])
    numb, differ, contrast = NULLS.values()
    assert all(numb.is_false(asked, claim) for claim in asked.family)
    assert not differ.is_false(asked, "frequency - structure")
    assert differ.is_false(asked, FOLLOWS)
    assert not contrast.is_false(asked, FOLLOWS)
    one = ALONE["one of the conditions"]
    assert not one.is_false(asked, "frequency - structure")
    assert one.is_false(asked, "structure - voltage")
    group = ALONE["one of the groups"]
    assert not group.is_false(asked, GROUP_SCORE)
    assert not group.is_false(asked, "pressure: middle - old between groups")
    assert group.is_false(asked, "pressure: young - middle between groups")
    assert group.is_false(asked, BY_GROUP)


@pytest.mark.parametrize("world", NULLS)
def test_few_reports_claim_what_is_false(world: str) -> None:
    any_false, each = reports("plain", NULLS[world], 90).false(NULLS[world])
    assert any_false.value <= 0.05 + 2 * any_false.error
    # Where responses follow by noticing alone, nothing that a plain report can claim is false.
    assert bool(each) == (NULLS[world] is not NULLS["noticing by contrast, gain 0"])


def test_the_slope_holds_where_a_slope_per_person_claims_the_prediction() -> None:
    made = reports("plain", ALL_NOTICED, 90)
    assert not too_often(made.rejects(FOLLOWS))
    assert share(made.t_of_slopes < 0.05).value > 0.2


@pytest.mark.soak
@pytest.mark.parametrize("study", IN_NULLS)
@pytest.mark.parametrize("world", NULLS)
def test_false_claims_of_any_kind(study: str, world: str) -> None:
    any_false, _ = reports(study, NULLS[world], COHORTS).false(NULLS[world])
    assert any_false.value <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / COHORTS)


@pytest.mark.soak
@pytest.mark.parametrize("world", ALONE)
def test_false_claims_beside_one_true_effect(world: str) -> None:
    """At most .05 of the other questions, and .05 of each family that waits for the true one."""
    made = reports(WITH_ALONE[world], ALONE[world], COHORTS)
    any_false, _ = made.false(ALONE[world])
    # Pairs of groups wait, and those in single conditions.
    most = 0.15 if "groups" in ALONE[world].true else 0.1
    assert any_false.value <= most + 2 * np.sqrt(most * (1 - most) / COHORTS)
    assert made.supports(GROUP_SCORE if "groups" in ALONE[world].true else OMNIBUS).value > 0.9


@pytest.mark.soak
def test_the_how_to_s_study_can_tell_its_factors() -> None:
    made = reports("the how-to's", World(population=DEFAULT), HOW_TO)
    assert made.rejects(OMNIBUS).value > 0.6
    assert made.rejects("effect of frequency").value > 0.6
    assert made.rejects(FOLLOWS).value > 0.8
    assert (made.complete < 2).all(), "scored cells alone would test no factor at all"
