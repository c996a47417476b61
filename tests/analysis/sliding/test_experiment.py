"""The findings of a sliding experiment: tables, figure, error measures and calibration."""

from functools import cache

import numpy as np
import pytest

from analysis.estimates import NotEstimable
from analysis.report.drawing import panels_files
from analysis.sliding.comparison import figure_panels
from analysis.sliding.experiment import SlidingFindings, data_digest, sliding_findings
from device.friction.laws import LAWS
from device.friction.rungs import RUNG_NAMES, TOP_RUNG
from tests.analysis.sliding.rigs import Setting, default_plan, passes, rig

OWN = rig(5)


@cache
def findings() -> SlidingFindings:
    made = passes(OWN, default_plan(OWN.measured_hz), 5)
    found = sliding_findings(made, OWN.measured_hz, "slide/1")
    assert isinstance(found, SlidingFindings)
    return found


def test_friction_at_rest_is_that_of_the_passes_with_the_output_off() -> None:
    mu = findings().nominal.friction_coefficient
    assert mu == pytest.approx(OWN.true.friction_coefficient, rel=0.06)
    assert findings().nominal.resonance_hz == OWN.measured_hz


def test_curves_lie_about_true_friction_by_their_standard_error() -> None:
    ratios = []
    gain = findings().fit.rig.friction_coefficient / OWN.true.friction_coefficient
    for curve in findings().curves:
        own = curve.setting
        setting = Setting(voltage_v=own.voltage_v, frequency_hz=own.frequency_hz)
        true = gain * OWN.friction(setting, curve.x_m)
        ratios.append((curve.mu - true) / curve.error)
    assert np.concatenate(ratios).std() == pytest.approx(1, abs=0.15)
    assert sum(curve.passes for curve in findings().curves) == 11


def test_the_law_and_rung_that_made_the_passes_fit_best() -> None:
    found = findings().mismatches
    assert len(found) == 2 * len(RUNG_NAMES) * len(LAWS)
    best = min(found, key=lambda one: one.rmse)
    assert (best.law, best.fitted) == ("consistent", True)
    assert best.rung == TOP_RUNG
    assert best.rmse < 0.02
    assert best.mean_absolute < best.rmse
    assert best.places_m < 0.2e-3
    by_law = {law: min(one.rmse for one in found if one.law == law) for law in LAWS}
    assert by_law["coulomb"] > 5 * best.rmse


def test_the_figure_has_measured_friction_beside_each_law_and_rung() -> None:
    found = findings()
    panels = figure_panels(found.curves, found.nominal, found.fit.rig)
    assert len(panels) == 2 + 1 + 8
    assert [line.label for line in panels[0].series] == ["measured", *LAWS]
    assert "23200 Hz" in panels[0].title
    assert panels[2].series[-1].label == TOP_RUNG
    drawn = panels_files(panels, ["svg"])
    assert drawn["svg"].startswith(b"<svg")
    assert drawn == panels_files(panels, ["svg"])


def test_tables_say_what_is_not_known_and_why() -> None:
    rows = {row[0]: row for row in findings().lines()}
    assert rows["damping ratio"][2].startswith("0.00")
    assert rows["sliding speed"][1] == "not determined"
    assert "(h/2 + h_c)/v alone" in rows["sliding speed"][2]
    assert "speed over the measured one" in rows
    assert len(findings().extreme_lines()) == 1 + len(findings().extremes)
    assert len(findings().mismatch_lines()) == 1 + len(findings().mismatches)


def test_the_findings_are_those_of_all_passes() -> None:
    found = findings()
    assert (found.session, len(found.binned), len(found.curves)) == ("slide/1", 11, 9)
    assert set(found.estimates) >= {"damping_ratio", "resonance_hz", "speed_ratio"}
    assert found.fit.deviance / found.fit.points == pytest.approx(1, abs=0.05)


def test_the_calibration_names_session_and_data() -> None:
    kept = findings().calibration_record()
    assert kept["session"] == "slide/1"
    assert len(kept["data_sha256"]) == 64
    damping = kept["damping_ratio"]
    assert damping["low"] < damping["value"] < damping["high"]


def test_the_digest_depends_on_every_sample() -> None:
    made = passes(OWN, [Setting(frequency_hz=24_000.0, speed_m_s=0.04)], 1)
    before = data_digest(made)
    assert data_digest(made) == before
    made[0].mu[-1] += 1e-9
    assert data_digest(made) != before


def test_passes_with_the_output_off_alone_give_a_reason() -> None:
    made = passes(OWN, [Setting(voltage_v=0.0, frequency_hz=24_000.0, speed_m_s=0.04)], 1)
    found = sliding_findings(made, 24_000.0, "slide/1")
    assert found == NotEstimable("no pass was driven")
