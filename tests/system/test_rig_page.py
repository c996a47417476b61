"""The examples of docs/rig.md are studies and settings that touchbeam takes."""

import tomllib
from pathlib import Path

import pytest

from handbook.examples import run_page
from protocol.study.rig_settings import Rig
from runner.study.calibration import kept_calibration
from tests.runner.command_line import typed

PAGE = (Path(__file__).parents[2] / "docs" / "rig.md").read_text(encoding="utf-8")
RIGS = [part.partition("```")[0] for part in PAGE.split("```toml\n")[1:]]


@pytest.mark.parametrize("example", RIGS)
def test_the_settings_of_the_page_are_those_of_a_rig(example: str) -> None:
    (settings,) = tomllib.loads(example).values()
    rig = Rig.model_validate(settings)
    assert rig.max_voltage_v <= 200
    if rig.dialect != "board":
        assert rig.amplifier_gain is not None
        peak_v = rig.generator_max_vpp * rig.amplifier_gain / 2
        assert peak_v >= rig.max_voltage_v, "else the study of the page is refused"


def test_the_study_for_the_meter_drives_ten_volts_at_most(tmp_path: Path) -> None:
    assert list(run_page(PAGE, tmp_path)) == []
    folder = tmp_path / "tenvolts"
    assert typed("check", folder) == 0
    resonance = kept_calibration(folder)
    assert resonance is not None
    assert resonance.frequency_hz == 24221
    rig = tomllib.loads((folder / "study.toml").read_text(encoding="utf-8"))["rig"]
    assert rig["max_voltage_v"] == 10
