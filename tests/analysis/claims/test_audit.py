"""The audit of the paper, the ladder and the figures: form, and known results."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from analysis.claims import human_factors, published_scores
from analysis.claims.audit import CLAIMS, claims_lines, counts, summary_line
from analysis.claims.claim import Audited, Verdict
from analysis.model import ladder
from analysis.model.ladder import LadderRow, ladder_lines, ladder_panel
from analysis.report.drawing import panels_files
from analysis.trials.law_likelihood import LawOrder, law_order
from handbook.figures import model_figures

REQUIRED = """
eq4-static-load eq15-continuous eq15-period fig11-range fig12-range fig12-troughs
fig12-four-troughs lambda drive-near-natural-frequency fig8-range fig8-linear-in-a fig8-crossing
u-lowers-mu-fixed-a u-lowers-mu-fixed-ratio omega-raises-mu voltage-lowers-mu pressure-lowers-mu
swing-grows-with-voltage fewer-peaks-at-lower-frequency direction-swaps all-nine-smoother
table4-averages table4-lowest table4-range voltage-best pressure-weakest density-strengthens
approach-strengthens
receptor-sensitivity-differs third-subject-like-others all-as-expected eq11-inner-limit
eq12-local-load inertia-half raise-a-and-voltage device-performs-well mu-of-copper
sliding-errors-at-peaks frequency-changes-mode
"""


def test_claims_are_complete_and_distinct() -> None:
    names = [claim.id for claim in CLAIMS]
    assert len(names) >= 93
    assert len(set(names)) == len(names)
    assert set(REQUIRED.split()) <= set(names)


@pytest.mark.parametrize(
    ("name", "printed", "consistent", "coulomb"),
    [
        ("eq4-static-load", "fails", "fails", "fails"),
        ("fig12-range", "holds", "partly", "partly"),
        ("fig12-troughs", "fails", "fails", "fails"),
        ("eq15-continuous", "fails", "fails", "fails"),
        ("patch-on-peak", "not testable", "not testable", "not testable"),
        ("voltage-lowers-mu", "fails", "fails", "partly"),
        ("swing-grows-with-voltage", "fails", "holds", "holds"),
        ("all-nine-smoother", "partly", "partly", "holds"),
        ("voltage-best", "partly", "partly", "partly"),
        ("receptor-sensitivity-differs", "not testable", "not testable", "not testable"),
        ("table4-averages", "holds", "holds", "holds"),
        ("table4-lowest", "fails", "fails", "fails"),
        ("no-signal-no-change", "fails", "holds", "holds"),
        ("sliding-matches-theory", "not testable", "fails", "fails"),
    ],
)
def test_known_verdicts(
    results: tuple[Audited, ...], name: str, printed: str, consistent: str, coulomb: str
) -> None:
    record = next(r.record() for r in results if r.claim.id == name)
    assert record["laws"] == {
        "printed": printed,
        "consistent": consistent,
        "coulomb": coulomb,
    }


def test_known_numbers(results: tuple[Audited, ...]) -> None:
    numbers = {r.claim.id: r.record()["computed"] for r in results}
    assert numbers["eq9-from-eq8"]["eq8_sum_n"] == pytest.approx(560, abs=1)
    assert numbers["eq9-from-eq8"]["eq9_n_m"] == pytest.approx(2.826, abs=1e-3)
    assert numbers["body-load"]["tip_deflection_m"] == pytest.approx(9.1e-3, abs=1e-4)
    assert numbers["voltage-lowers-mu"]["printed"]["per_volt"] == pytest.approx(2.83e-5, abs=1e-7)
    assert numbers["ranking-follows-model"]["consistent"]["spearman"] == pytest.approx(0.3)


def test_only_a_perfect_rank_correlation_of_five_means_is_significant(
    results: tuple[Audited, ...],
) -> None:
    remark = next(r.claim.remark for r in results if r.claim.id == "ranking-follows-model")
    assert "only the two perfect ones have p < .05" in remark
    law = law_order(tuple("abcde"), np.array([5.0, 4, 3, 1, 2]), np.array([5.0, 4, 3, 2, 1]))
    assert isinstance(law, LawOrder)
    assert law.spearman == pytest.approx(0.9)
    assert law.p == pytest.approx(1 / 12)


KEYS = {"id", "place", "claim", "check", "expected", "laws", "computed", "remark"}


def test_the_records_are_json_without_nan(results: tuple[Audited, ...]) -> None:
    records = json.loads(json.dumps([each.record() for each in results], allow_nan=False))
    assert set(records[0]) == KEYS | {"sentence", "law_free"}
    for record in records:
        assert set(record["laws"]) == {"printed", "consistent", "coulomb"}
        assert record["law_free"] is not (set(record["computed"]) == set(record["laws"]))


def test_law_free_claims_are_counted_once(results: tuple[Audited, ...]) -> None:
    found = counts(results)
    free = [result for result in results if result.claim.law_free]
    assert found["law-free"].total() == len(free)
    for law in ("printed", "consistent", "coulomb"):
        assert found[law].total() == len(results) - len(free)
        held = [r for r in results if r.outcomes[law].verdict is Verdict.HOLDS]
        assert found[law][Verdict.HOLDS] == len([r for r in held if r not in free])


def test_the_table_has_the_sentence_of_each_claim(results: tuple[Audited, ...]) -> None:
    header, *rows, last = claims_lines(results)
    assert header == ["claim", "law-free", "printed", "consistent", "coulomb"]
    by_name = {row[0].split(" ")[0]: row for row in rows}
    for result in results:
        row = by_name[result.claim.id]
        assert result.sentence in row[0]
        assert result.claim.remark in row[0]
        assert [bool(cell) for cell in row[1:]] == (
            [True, False, False, False] if result.claim.law_free else [False, True, True, True]
        )
    verdicts = rows[len(results) :]
    assert [row[0] for row in verdicts] == [f"count: {verdict}" for verdict in Verdict]
    assert [sum(int(row[column]) for row in verdicts) for column in range(1, 5)] == [
        int(total) for total in last[1:]
    ]


def test_the_summary_counts_the_claims_that_hold(results: tuple[Audited, ...]) -> None:
    found = counts(results)
    held = {name: counter[Verdict.HOLDS] for name, counter in found.items()}
    assert summary_line(results) == (
        f"Hold: {held['law-free']} of {found['law-free'].total()} law-free; of "
        f"{found['printed'].total()} others printed {held['printed']}, consistent "
        f"{held['consistent']}, coulomb {held['coulomb']}"
    )


def test_human_claims_have_their_uncertainty_in_the_sentence(
    results: tuple[Audited, ...],
) -> None:
    human = {claim.id for room in (published_scores, human_factors) for claim in room.CLAIMS}
    assert len(human) > 15
    for result in results:
        words = {outcome.evidence for outcome in result.outcomes.values()}
        assert len(words) == 1  # the people are the same under every law
        assert bool(words.pop()) is (result.claim.id in human)
        if result.claim.id in human:
            numbers = json.dumps(result.record()["computed"])
            assert "_interval" in numbers or '"interval' in numbers or '"p_holm"' in numbers
            assert any(sign in result.sentence for sign in ("Holm p", "95%", "p = "))


def test_claims_that_are_not_testable_give_the_reason(results: tuple[Audited, ...]) -> None:
    for result in results:
        if Verdict.NOT_TESTABLE in {outcome.verdict for outcome in result.outcomes.values()}:
            assert result.claim.remark


def test_the_ladder_is_written_and_drawn() -> None:
    rows = tuple(
        LadderRow(
            rung=name,
            setup_us=t,
            setup_us_range=(t - 1, 2 * t),
            us_per_1000=80.0,
            us_per_1000_range=(79.0, 90.0),
            max_error=e,
            rms_error=e / 2,
            resonance_hz=2e4,
        )
        for name, t, e in (("mode", 9.0, 0.04), ("timoshenko-patched", 5e3, 0.0))
    )
    assert asdict(rows[0])["max_error"] == 0.04
    assert ladder_lines(rows)[1] == [
        "mode",
        "9 (8 to 18)",
        "80 (79 to 90)",
        "0.040",
        "0.0200",
        "20000.0",
    ]
    assert asdict(rows[0])["setup_us_range"] == (8.0, 18.0)
    drawings = panels_files([ladder_panel(rows)], ["svg", "png"])
    assert drawings["svg"].startswith(b"<svg")
    assert drawings["png"].startswith(b"\x89PNG")
    assert drawings == panels_files([ladder_panel(rows)], ["svg", "png"])


def test_the_ladder_times_its_rungs_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pause of the computer in one round changes no median."""
    clock = iter(float(k) for k in range(10_000))
    readings = iter(range(10_000))
    late = 0.0

    def now() -> float:
        nonlocal late
        late += 1e3 if 100 <= next(readings) < 110 else 0.0
        return next(clock) + late

    monkeypatch.setattr(ladder, "perf_counter", now)
    for row in ladder.measured_ladder():
        assert row.setup_us == row.us_per_1000 == 1e6
        assert row.setup_us_range[0] == 1e6


def test_every_figure_of_the_documentation_has_finite_curves() -> None:
    figures = model_figures()
    page = Path("docs/model.md").read_text(encoding="utf-8")
    for name, panels in figures.items():
        assert f"(model/{name}.svg)" in page
        for panel in panels:
            for series in panel.series:
                assert np.isfinite(series.y).all()
                assert series.x.shape == series.y.shape
