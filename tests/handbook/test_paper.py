"""The paper, reproduced: docs/paper.md says what is computed; verdicts move with what decides."""

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from analysis.estimates import FloatArray
from handbook.build import ROOT
from handbook.paper import checks, people, scenes
from handbook.paper.claim import judged, near
from handbook.paper.claims import CLAIMS
from handbook.paper.figures import figures, svg
from handbook.paper.page import page
from handbook.paper.people import gain_spread, gains_differ, scored_above

FOLDER = ROOT / "docs" / "paper"
BY_ID = {claim.id: claim for claim in CLAIMS}
KEYS = {"id", "place", "claim", "check", "expected", "laws", "computed", "remark"}


@pytest.fixture(scope="module")
def computed() -> list[dict[str, Any]]:
    return [claim.record() for claim in CLAIMS]


@pytest.fixture(scope="module")
def written() -> list[dict[str, Any]]:
    records: list[dict[str, Any]] = json.loads((FOLDER / "claims.json").read_text(encoding="utf-8"))
    return records


def flat(value: Any, path: str = "") -> dict[str, float]:
    """The numbers of a JSON value by their paths; a word is a part of its path."""
    if isinstance(value, Mapping):
        parts: Any = value.items()
    elif isinstance(value, list):
        parts = enumerate(value)
    else:
        return {path: value} if isinstance(value, int | float) else {f"{path} {value}": 0.0}
    return {key: leaf for name, part in parts for key, leaf in flat(part, f"{path}/{name}").items()}


def test_every_claim_and_verdict_is_as_written(
    computed: list[dict[str, Any]], written: list[dict[str, Any]]
) -> None:
    assert len(written) == len({record["id"] for record in written}) >= 45
    for ours, theirs in zip(computed, written, strict=True):
        assert set(theirs) == KEYS
        assert {**ours, "computed": 0} == {**theirs, "computed": 0}, "run: make paper"
        # The last digits may differ by computer.
        numbers = pytest.approx(flat(theirs["computed"]), rel=1e-4, abs=1e-8)
        assert flat(ours["computed"]) == numbers, theirs["id"]


def test_the_page_shows_what_is_written(written: list[dict[str, Any]]) -> None:
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    assert text == page(written), "run: make paper"
    drawn = {f"figure-{number}.svg" for number in figures()}
    assert set(re.findall(r"\(paper/(.*\.svg)\)", text)) == drawn
    assert {path.name for path in FOLDER.iterdir()} == {*drawn, "claims.json"}


def test_a_claim_that_left_has_a_reason_and_no_check() -> None:
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    rows = text.partition("## Claims that are not checked")[2]
    left = re.findall(r"^\| `(\S+)` \| (.+) \|$", rows, flags=re.MULTILINE)
    assert all(reason for _, reason in left)
    names = [name for name, _ in left]
    assert len(names) == len(set(names) - set(BY_ID)) == 93 - len(CLAIMS)
    # A reason may lean on a claim that is checked.
    assert set(re.findall(r"`(\S+)`", " ".join(reason for _, reason in left))) <= set(BY_ID)


def test_figures_have_finite_curves_and_the_same_bytes_each_time() -> None:
    for panels in figures().values():
        for panel in panels:
            for curve in panel.curves.values():
                assert curve.shape == panel.x.shape
                assert np.isfinite(curve).all()
    panels = figures()["8"]
    assert svg(panels) == svg(panels)
    assert "Fig 8, by law" in svg(panels)


@pytest.mark.parametrize(
    ("name", "printed", "consistent", "coulomb"),
    [
        ("eq4-static-load", "fails", "fails", "fails"),
        ("eq15-continuous", "fails", "fails", "fails"),
        ("fig12-range", "holds", "partly", "partly"),
        ("fig12-troughs", "fails", "fails", "fails"),
        ("voltage-lowers-mu", "fails", "fails", "partly"),
        ("swing-grows-with-voltage", "fails", "holds", "holds"),
        ("no-signal-no-change", "fails", "holds", "holds"),
        ("sliding-matches-theory", "not testable", "fails", "fails"),
        ("all-nine-smoother", "partly", "partly", "holds"),
        ("voltage-best", "partly", "partly", "partly"),
        ("receptor-sensitivity-differs", *["not testable"] * 3),
        ("table4-averages", "holds", "holds", "holds"),
        ("table4-lowest", "fails", "fails", "fails"),
    ],
)
def test_verdicts_that_the_page_explains(
    computed: list[dict[str, Any]], name: str, printed: str, consistent: str, coulomb: str
) -> None:
    (record,) = (record for record in computed if record["id"] == name)
    expected = {"printed": printed, "consistent": consistent, "coulomb": coulomb}
    assert record["laws"] == expected


def test_known_numbers(written: list[dict[str, Any]]) -> None:
    of = {record["id"]: record["computed"] for record in written}
    assert of["eq9-from-eq8"]["eq8_sum_n"] == pytest.approx(560, abs=1)
    assert of["eq9-from-eq8"]["eq9_n_m"] == pytest.approx(2.826, abs=1e-3)
    assert of["eq15-continuous"]["jumps"] == pytest.approx([0, 0, 0, 0.13, 0, 0.26], abs=1e-5)
    # F L³ / (8 E I) and F L / 2 · h/2 / I, I = W h³ / 12
    inertia = 5e-3**4 / 12
    tip_m, stress_pa = 400 * 0.1**3 / (8 * 105e9 * inertia), 400 * 0.05 * 2.5e-3 / inertia
    assert of["body-load"]["tip_deflection_m"] == pytest.approx(tip_m, rel=1e-5)
    assert of["body-load"]["stress_pa"] == pytest.approx(stress_pa, rel=1e-5)
    needed = of["drive-near-natural-frequency"]["damping_ratio_needed"]
    assert needed == pytest.approx([0.0048, 0.1201], abs=1e-4)
    gains = of["receptor-sensitivity-differs"]["printed"]["gains_on_condition_means"]
    assert (gains["f"], gains["p"]) == pytest.approx((0.978, 0.476), abs=1e-3)


# Verdicts


@pytest.mark.parametrize(
    ("main", "details", "verdict"),
    [
        (True, (), "holds"),
        ([True, True], (True,), "holds"),
        (False, (True, True), "fails"),
        ([False, None], (), "fails"),
        ([True, False], (), "partly"),
        ([True, None], (), "partly"),
        (True, (False,), "partly"),
        (True, (None,), "partly"),
        (None, (True,), "not testable"),
        ([], (), "not testable"),
    ],
)
def test_the_main_statement_decides_and_details_take_from_it(
    main: object, details: tuple[bool | None, ...], verdict: str
) -> None:
    assert judged(main, *details).verdict == verdict


def test_near_judges_each_value() -> None:
    assert near(1.0, 0.1, a=1.05, b=1.2).scope == (True, False)


def test_a_verdict_moves_with_the_curve_or_the_load() -> None:
    line = np.linspace(0.6, 0.2, 21)
    assert checks.from_02_to_06(line).verdict == "holds"
    assert checks.from_02_to_06(line - 0.1).verdict == "fails"
    assert checks.straight(line).verdict == "holds"
    assert checks.straight(line**2).verdict == "partly"
    assert checks.straight(-line).verdict == "fails"
    assert (
        checks.falling(a=line, b=-line).verdict
        == checks.rising(a=line, b=-line).verdict
        == "partly"
    )
    # With 20 N in all instead of on each body.
    assert checks.withstood(20.0).verdict == "holds"
    assert checks.near_resonance(scenes.RESONANCE_HZ).verdict == "partly"


def test_eq_15_without_jumps_would_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "same_direction_ratio", lambda x_m, *_: 10 * x_m)
    assert checks.jumps_of_eq15().verdict == "holds"
    assert checks.range_of_eq15().verdict == "fails"


@pytest.mark.parametrize("law", ["consistent", "coulomb"])
def test_with_more_damping_the_sliding_experiment_has_a_theory_to_match(law: str) -> None:
    shares = checks.varies_when_sliding(law).computed
    assert shares["share_at_damping_ratio_0.005"] < 0.16
    assert shares["share_at_damping_ratio_0.03"] > 0.5


# People


def scored(monkeypatch: pytest.MonkeyPatch, means: Mapping[str, float], p: float) -> None:
    monkeypatch.setattr(people, "MEANS", means)
    monkeypatch.setattr(checks, "MEANS", means)
    for pair in list(people.P_HOLM):
        monkeypatch.setitem(people.P_HOLM, pair, p)


def test_clear_scores_decide_with_the_law(monkeypatch: pytest.MonkeyPatch) -> None:
    means = dict(zip(people.NAMES, (6.0, 7.0, 8.0, 5.0, 2.0), strict=True))
    scored(monkeypatch, means, 0.01)
    verdicts = {name: BY_ID[name].outcome for name in BY_ID}
    assert verdicts["voltage-best"]("coulomb").verdict == "holds"
    assert verdicts["voltage-best"]("consistent").verdict == "partly"  # its largest is direction
    assert verdicts["pressure-weakest"]("consistent").verdict == "holds"
    assert verdicts["structure-and-voltage-lead"]("coulomb").verdict == "partly"
    scored(monkeypatch, {name: -mean for name, mean in means.items()}, 0.01)
    for name in ("voltage-best", "pressure-weakest", "structure-and-voltage-lead"):
        assert verdicts[name]("coulomb").verdict == "fails"
    scored(monkeypatch, means, 0.2)
    assert scored_above("coulomb", ["voltage"], people.NAMES, True).verdict == "not testable"


@pytest.mark.parametrize(
    ("scores", "verdict"),
    [((5.0, 4.0, 8.0, 6.0, 2.0), "holds"), ((5.0, 6.0, 2.0, 4.0, 8.0), "fails")],
)
def test_the_ranking_rests_on_the_pairs_that_people_tell_apart(
    monkeypatch: pytest.MonkeyPatch, scores: tuple[float, ...], verdict: str
) -> None:
    open_pairs = checks.order_of_conditions("consistent").scope.count(None)
    assert open_pairs == 9
    scored(monkeypatch, dict(zip(people.NAMES, scores, strict=True)), 0.01)
    assert checks.order_of_conditions("coulomb").verdict == verdict


def test_a_withheld_score_contradicts_that_all_agreed(monkeypatch: pytest.MonkeyPatch) -> None:
    from handbook.paper import claims

    withheld = people.SCORES.copy()
    withheld[2, 4] = 0
    monkeypatch.setattr(claims, "SCORES", withheld)
    assert BY_ID["all-as-expected"].outcome("consistent").verdict == "fails"


X = np.array([0.19, 0.1, 0.35, 0.45, 0.07])


def simulated(random: np.random.Generator, gain_sd: float, noise: float = 1.0) -> FloatArray:
    gains, levels = random.normal(6.0, gain_sd, 9), random.normal(7.0, 1.0, 9)
    errors = random.normal(0.0, noise, (9, X.size)) + random.normal(0.0, 1.0, X.size)
    return np.asarray(levels[:, None] + gains[:, None] * X + errors)


@pytest.mark.parametrize("gain_sd", [0.0, 3.0, 10.0])
def test_the_interval_covers_the_true_spread_of_gains(gain_sd: float) -> None:
    random = np.random.default_rng(1)
    ends = [gain_spread(simulated(random, gain_sd), X)["sd_interval"] for _ in range(2000)]
    covered = np.mean([low <= gain_sd <= high for low, high in ends])
    # 0 is covered unless the lower limit is above it: one-sided, .975.
    assert covered == pytest.approx(0.975 if gain_sd == 0 else 0.95, abs=0.015)


@pytest.mark.parametrize(
    ("gain_sd", "noise", "differ"), [(10.0, 0.3, True), (0.0, 0.05, False), (0.0, 1.5, None)]
)
def test_people_differ_where_their_scores_show_it(
    gain_sd: float, noise: float, differ: bool | None
) -> None:
    scores = simulated(np.random.default_rng(3), gain_sd, noise)
    assert gains_differ(gain_spread(scores, X)) is differ
