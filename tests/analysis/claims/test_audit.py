"""The audit of the paper, the ladder and the figures: form, and known results."""

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.claims.audit import CLAIMS, audit, claims_json, claims_lines
from analysis.claims.claim import Audited, Finding, Verdict
from analysis.model import ladder
from analysis.model.figures import model_figures
from analysis.model.ladder import LadderRow, ladder_json, ladder_lines, ladder_panel
from analysis.report.drawing import panels_figure
from analysis.trials.law_order import LawOrder, law_order

REQUIRED = """
eq4-static-load eq15-continuous eq15-period fig11-range fig12-range fig12-troughs
fig12-four-troughs lambda drive-near-natural-frequency fig8-range fig8-linear-in-a fig8-crossing
u-lowers-mu-fixed-a u-lowers-mu-fixed-ratio omega-raises-mu voltage-lowers-mu pressure-lowers-mu
swing-grows-with-voltage fewer-peaks-at-lower-frequency direction-swaps all-nine-smoother
table4-averages table4-lowest table4-range voltage-best pressure-weakest density-strengthens
approach-strengthens
"""


@pytest.fixture(scope="module")
def results() -> tuple[Audited, ...]:
    return audit()


def test_claims_are_complete_and_distinct() -> None:
    names = [claim.id for claim in CLAIMS]
    assert len(names) >= 45
    assert len(set(names)) == len(names)
    assert set(REQUIRED.split()) <= set(names)


def test_verdicts_follow_from_the_parts() -> None:
    assert Finding(parts=(True, True)).verdict is Verdict.HOLDS
    assert Finding(parts=(True, False)).verdict is Verdict.PARTLY
    assert Finding(parts=(True, None)).verdict is Verdict.PARTLY
    assert Finding(parts=(False, None)).verdict is Verdict.FAILS
    assert Finding(parts=(None,)).verdict is Verdict.NOT_TESTABLE


@pytest.mark.parametrize(
    ("name", "printed", "consistent", "coulomb"),
    [
        ("eq4-static-load", "fails", "fails", "fails"),
        ("fig12-range", "holds", "partly", "partly"),
        ("fig12-troughs", "fails", "fails", "fails"),
        ("voltage-lowers-mu", "partly", "partly", "partly"),
        ("swing-grows-with-voltage", "fails", "holds", "holds"),
        ("all-nine-smoother", "fails", "fails", "holds"),
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


def test_the_records_are_json_without_nan(results: tuple[Audited, ...]) -> None:
    text = json.dumps(claims_json(results), allow_nan=False)
    assert {"id", "place", "claim", "check", "expected", "laws", "computed", "remark"} == set(
        json.loads(text)[0]
    )
    assert len(claims_lines(results)) == len(CLAIMS) + 2


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
    assert ladder_json(rows)[0]["max_error"] == 0.04
    assert ladder_lines(rows)[1] == [
        "mode",
        "9 (8 to 18)",
        "80 (79 to 90)",
        "0.040",
        "0.0200",
        "20000.0",
    ]
    assert ladder_json(rows)[0]["setup_us_range"] == (8.0, 18.0)
    drawing = panels_figure([ladder_panel(rows)])
    assert drawing.startswith(b"<svg")
    assert drawing == panels_figure([ladder_panel(rows)])
    assert panels_figure([ladder_panel(rows)], "png").startswith(b"\x89PNG")


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
