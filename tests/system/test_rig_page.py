"""The examples of docs/rig.md are studies and settings that touchbeam takes."""

import io
import socket
import tomllib
from pathlib import Path
from typing import Any, cast

import pytest

from device.guardian import guardian_of
from device.link.port import SerialPort
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


class Connected:
    """A port as pySerial has it, which names its connection or not."""

    def __init__(self, kind: str, made: socket.socket) -> None:
        self._descriptor = None if kind == "rfc2217://" else made.fileno()
        if kind != "serial port":
            self._socket = made

    def fileno(self) -> int:
        if self._descriptor is None:
            raise io.UnsupportedOperation
        return self._descriptor


TABLE = PAGE.partition("is noticed by |\n|---|---|---|\n")[2].partition("\n\n")[0]
ROWS = [[word.strip("* `") for word in row.split("|")[1:4]] for row in TABLE.splitlines()]


@pytest.mark.parametrize(("systems", "kinds", "by"), ROWS)
def test_the_table_of_the_guardian_is_what_it_can_do(
    monkeypatch: pytest.MonkeyPatch, systems: str, kinds: str, by: str
) -> None:
    everything = ["socket://", "serial port", "rfc2217://"]
    with socket.create_server(("127.0.0.1", 0)) as server:
        for kind in everything if kinds == "any" else [kinds]:
            assert kind in everything
            with socket.create_connection(server.getsockname()) as made:
                port = SerialPort(cast(Any, Connected(kind, made)))
                system = "nt" if systems == "Windows" else "posix"
                monkeypatch.setattr("device.guardian.os.name", system)
                guardian = guardian_of(port.shared, b"off", 0.5)
                monkeypatch.undo()
            assert (guardian is not None) is (by == "the guardian")
