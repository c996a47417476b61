"""Claims under all choices of analysis: small tables whose truths were computed by hand."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from analysis.estimates import NotEstimable
from analysis.loading.sessions import load_sessions
from analysis.loading.study_data import study_data
from analysis.multiverse.curve import (
    Curve,
    Judged,
    Multiverse,
    PeopleClaim,
    above,
    curve,
    multiverse,
    named_claims,
)
from analysis.multiverse.universes import NOTHING, STRICT, Choice, Universe, universes
from analysis.trials.contrasts import BEAM_MODELS
from device.friction.laws import LAWS
from protocol.journal.events import Event, StoredEvent, TouchEnded, TrialExcluded
from tests.analysis.chains import chain, published_chain, scored_session
from tests.analysis.friction.recorded_sessions import recorded_cohort
from tests.analysis.reports import PAPER, session_events

PAIR = ("voltage", "pressure")


def explored(
    chains: Sequence[Sequence[StoredEvent]], claims: Sequence[PeopleClaim] | None = None
) -> Multiverse:
    recorded = load_sessions(chains)
    decided = study_data(recorded, rehearsals=False, rules=PAPER.exclusions)
    return multiverse(recorded, decided, PAPER, claims=claims)


def curves(found: Multiverse) -> dict[str, Curve]:
    return {each.claim.id: each for each in found.curves}


def table(rows: Sequence[Sequence[float | None]], names: Sequence[str] = PAIR) -> Multiverse:
    return explored(
        [
            published_chain(f"P0{number}", dict(zip(names, row, strict=True)))
            for number, row in enumerate(rows)
        ]
    )


@cache
def blanks() -> Multiverse:
    """Voltage has 9 points of one subject, two blanks; pressure has 5 of everybody."""
    return table([[9, 5], [None, 5], [None, 5]])


def test_a_claim_flips_with_the_reading_of_missing_scores() -> None:
    """Differences: 4 alone if missing; 4, -5, -5 if 0; 4, 0, 0 if the lowest score, 5."""
    found = curves(blanks())["voltage-best"]
    assert [it.effect for it in found.judged] == [-2, pytest.approx(4 / 3), 4]
    assert [it.p for it in found.judged] == [0.5, 1.0, 1.0]
    assert [it[Choice.READING] for it in found.chosen] == [
        *("as 0", "as the lowest score", "left missing")
    ]
    assert (found.tally.analyses, found.tally.supported, found.tally.significant) == (3, 2, 0)
    assert found.decides == Choice.READING
    assert found.moves == {Choice.READING: 6}
    assert found.own == 2
    assert [it.supported for it in found.by_option(Choice.READING).values()] == [1, 0, 1]


def test_agreement_is_kendalls_and_what_cannot_be_judged_is_counted() -> None:
    """Ranks 2, 1 once and 1, 2 twice: W = 1/9; 2, 1 once and ties else: W = 1/3."""
    found = curves(blanks())["conditions-differ"]
    assert [it.effect for it in found.judged] == [pytest.approx(1 / 9), pytest.approx(1 / 3)]
    assert found.unjudged == {"at least 2 subjects must score two conditions, got 1": 1}
    assert found.own is None


def test_agreement_with_a_score_missing_is_a_share_of_what_it_cannot_exceed() -> None:
    """A = (2√3 + 1, -1, -2√3), T = (64 + 8√3) / 16, of at most 2 + 1 + 2."""
    found = curves(table([[9, 7, 5], [8, 6, None], [9, 8, 2]], (*PAIR, "structure")))
    agreement = found["conditions-differ"]
    own = agreement.own
    assert own is not None
    assert agreement.chosen[own][Choice.READING] == "left missing"
    assert agreement.judged[own].effect == pytest.approx((8 + np.sqrt(3)) / 10)


def test_pairs_of_conditions_are_counted_in_the_direction_of_most_analyses() -> None:
    (pair,) = blanks().pairs
    assert (pair.above, pair.below, pair.analyses, pair.supported) == (*PAIR, 3, 2)
    assert (pair.least, pair.largest) == (-2, 4)
    (turned,) = table([[5, 9], [5, 9]]).pairs
    assert (turned.above, turned.below, turned.least) == ("pressure", "voltage", 4)


def test_choices_that_do_not_differ_are_not_multiplied_but_named() -> None:
    found = table([[9, 5, 7], [8, 4, 7]], (*PAIR, "structure"))
    assert set(found.single) == {Choice.READING, Choice.EXCLUSIONS, Choice.CONTRAST}
    assert "no score was withheld, so that the three readings are one" in found.single.values()
    assert curves(found)["voltage-best"].tally.analyses == 1
    order = curves(found)["order-follows-model"]
    assert order.tally.analyses == len(LAWS) * len(BEAM_MODELS)
    assert list(order.options) == [Choice.LAW, Choice.RUNG]
    assert order.options[Choice.LAW][0] == "consistent", "the report's own option comes first"


def test_the_report_s_own_analysis_has_the_report_s_numbers() -> None:
    rows = [[9, 5, 7], [8, 4, 7], [7, 6, 8], [9, 5, 6]]
    found = curves(table(rows, (*PAIR, "structure")))["voltage-best"]
    assert found.own == 0
    # Least difference: voltage - structure, 2, 1, -1, 3; V = 8.5 of 10, p = 6/16, over three pairs.
    assert found.judged[0].effect == 1.25
    assert found.judged[0].p == pytest.approx(6 / 16)


def test_conditions_of_ones_own_have_the_claims_that_name_none() -> None:
    ids = [each.id for each in named_claims(("rough", "fine"))]
    assert ids == ["conditions-differ", "order-follows-model"]


def scored(who: str, voltage: int, pressure: int) -> list[Event]:
    return scored_session(who, zip(PAIR, (voltage, pressure), strict=True), PAIR)


def test_what_was_excluded_counts_again_where_nothing_is() -> None:
    """P02's trial of voltage was excluded: with it the mean difference is -1 instead of 4."""
    excluded = [*scored("P02", 1, 7), TrialExcluded(index=0, reason="a noise")]
    found = explored([chain(it) for it in (scored("P01", 9, 5), excluded)])
    voltage = curves(found)["voltage-best"]
    assert voltage.options == {Choice.EXCLUSIONS: ("as decided", NOTHING)}
    assert [it.effect for it in voltage.judged] == [-1, 4]
    assert voltage.decides == Choice.EXCLUSIONS


def test_touches_not_as_instructed_are_one_more_reason_to_exclude() -> None:
    chains = [session_events(PAPER, slot, np.random.default_rng(slot)) for slot in range(3)]
    last = max(place for place, event in enumerate(chains[0]) if isinstance(event, TouchEnded))
    ended = chains[0][last]
    assert isinstance(ended, TouchEnded)
    chains[0][last] = replace(ended, judged=replace(ended.judged, force_ok=False))
    found = explored([chain(events) for events in chains])
    assert curves(found)["voltage-best"].options[Choice.EXCLUSIONS] == ("as decided", STRICT)


def test_measured_contrasts_are_an_option_without_law_and_rung() -> None:
    chains, _ = recorded_cohort(PAPER, 4, skipped=2)
    order = curves(explored(chains))["order-follows-model"]
    assert "measured" in order.options[Choice.CONTRAST]
    measured = [it for it in order.chosen if it[Choice.CONTRAST] == "measured"]
    readings = len(order.options.get(Choice.READING, ("one",)))
    assert len(measured) == readings
    assert not any(Choice.LAW in it or Choice.RUNG in it for it in measured)


def test_claims_are_an_argument() -> None:
    """Pressure above voltage, as a study may have registered: the opposite of the paper's claim."""
    claim = above("registered", "Pressure is rated above voltage", [("pressure", "voltage")])
    rows = [published_chain("P01", {"voltage": 9, "pressure": 5})]
    (found,) = explored(rows, [claim]).curves
    assert [it.effect for it in found.judged] == [-4]
    assert found.tally.supported == 0


def universes_of_one() -> tuple[Universe, ...]:
    recorded = load_sessions([published_chain("P01", {"voltage": 9, "pressure": 5})])
    return universes(recorded, study_data(recorded, rehearsals=False), PAPER).tables


def test_the_report_s_own_analysis_is_no_other_one_where_it_has_no_contrasts() -> None:
    (own,) = universes_of_one()
    other = replace(own, chosen={Choice.LAW: "another"}, contrasts={"voltage": 0.1})
    claim = PeopleClaim(
        id="any", words="Any", effect="ρ", judge=lambda _: Judged(effect=1.0, p=0.5), of_model=True
    )
    found = curve(claim, (own, other))
    assert (len(found.judged), found.own) == (1, None)
    assert curve(claim, (other, own)).own == 0


def test_a_choice_decides_only_if_each_of_its_options_has_one_verdict() -> None:
    effects = {("a", "x"): 1.0, ("a", "y"): 2.0, ("b", "x"): -1.0, ("b", "y"): 5.0}
    (own,) = universes_of_one()
    analyses = {
        Universe(
            chosen={Choice.READING: one, Choice.LAW: other},
            reading=own.reading,
            contrasts={},
        ): effect
        for (one, other), effect in effects.items()
    }
    claim = PeopleClaim(
        id="any",
        words="Any",
        effect="points",
        judge=lambda it: Judged(effect=analyses[it], p=0.01),
    )
    found = curve(claim, tuple(analyses))
    assert found.decides is None
    # Means by reading: 1.5 and 2; by law: 0 and 3.5.
    assert found.moves == {Choice.READING: 0.5, Choice.LAW: 3.5}
    assert found.moves_most == Choice.LAW
    nobody = curve(replace(claim, judge=lambda _: NotEstimable("nobody scored")), tuple(analyses))
    assert nobody.unjudged == {"nobody scored": 4}
