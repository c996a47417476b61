"""The drivers behind one interface: the registry, the amplifier's arithmetic, order of set-up."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import device.drivers
from device.drivers.board import Board
from device.drivers.driver import driver_for, driver_of, drivers
from device.drivers.generator import Ramp
from device.drivers.keysight import Keysight
from device.drivers.limits import Amplifier, Limits, Setpoint
from device.drivers.rigol import Rigol
from device.drivers.siglent import Siglent
from device.errors import ForeignDevice, LimitExceeded
from device.link.link import Link
from device.simulator.client import ControlClient, simulator_process
from protocol.address import AddressError
from protocol.journal.records import ReadBack
from protocol.study_file.loading import StudyError, parsed_study, template
from tests.device.rigs import DRIVE, LIMITS, TOUCHBEAM, opened, until
from tests.device.scripted import ScriptedPort, ticking

ON = ReadBack(output=True, voltage_v=0.0, frequency_hz=1000.0)
NEW_DIALECT = """
import re
from device.drivers.board import Board

class Next(Board):
    dialect = "next"
    idn = re.compile("NEXT,")

DRIVER = Next
"""


def test_dialects_are_found_by_name_and_by_who_answers() -> None:
    assert driver_of("board") is Board
    assert driver_for("Agilent Technologies,33220A,MY44,2.02") is Keysight
    assert driver_for("Keysight Technologies,33512B,MY52,3.05") is Keysight
    assert driver_for("TOUCHBEAM,BOARD,7,1.1") is Board
    assert driver_for("Rigol Technologies,DG1062Z,DG1ZA0,03.01.12") is Rigol
    assert driver_for("RIGOL TECHNOLOGIES,DG832,DG8A0,00.02") is Rigol
    assert driver_for("Siglent Technologies,SDG2042X,SDG2X0,2.01") is Siglent
    with pytest.raises(AddressError, match="one of board, keysight, rigol, siglent, got 'acme'"):
        driver_of("acme")
    with pytest.raises(ForeignDevice) as refused:
        driver_for("Rigol,DG1022,1,2")
    assert str(refused.value) == (
        "expected one of: a board (TOUCHBEAM,BOARD,…); "
        "a generator (Agilent or Keysight 33220A, 33500 or 33600); "
        "a generator (Rigol DG800 or DG1000Z); a generator (Siglent SDG of the X series); "
        "got 'Rigol,DG1022,1,2'; nothing else was sent"
    )


@pytest.fixture
def next_dialect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A dialect that a new file brings."""
    (tmp_path / "next_dialect.py").write_text(NEW_DIALECT)
    monkeypatch.setattr(device.drivers, "__path__", [*device.drivers.__path__, str(tmp_path)])
    drivers.cache_clear()
    yield "next"
    drivers.cache_clear()
    sys.modules.pop("device.drivers.next_dialect", None)


def test_the_next_dialect_is_one_new_file(next_dialect: str) -> None:
    assert driver_of(next_dialect).dialect == next_dialect


def rig(dialect: str) -> str:
    keys = f'dialect = "{dialect}"\namplifier_gain = 20\ngenerator_max_vpp = 20'
    return template("paper").replace('device = "sim"', keys, 1)


def test_a_study_may_name_every_dialect_that_there_is(next_dialect: str) -> None:
    for dialect in drivers():
        assert parsed_study(rig(dialect), dialects={"dialects": drivers}).rig.dialect == dialect
    known = "'board', 'keysight', 'rigol', 'siglent' or 'next'"
    with pytest.raises(StudyError, match=f"{known}, got 'nxt'; did you mean"):
        parsed_study(rig("nxt"), dialects={"dialects": drivers})


def test_the_papers_numbers_for_the_amplifier() -> None:
    amplifier = Amplifier(max_slew_v_per_us=30.5, max_current_a=30.5e-3, load_f=1e-9)
    amplifier.check(200, 24_221)
    with pytest.raises(LimitExceeded, match=r"slew_v_per_us must .* got 30\.58"):
        amplifier.check(201, 24_221)
    assert Amplifier(gain=20).vpp(200) == 20
    assert Amplifier(gain=20).amplitude_v(20) == 200


@pytest.mark.parametrize(
    ("amplifier", "told"),
    [
        (Amplifier(max_slew_v_per_us=15), "slew_v_per_us must not exceed 15, got 15.21"),
        (Amplifier(max_current_a=0.1, load_f=10e-9), "current_a must not exceed 0.1, got 0.1521"),
        (Amplifier(gain=20, max_vpp=8), "peak-to-peak voltage must not exceed 8, got 10"),
    ],
)
def test_what_the_amplifier_cannot_follow_is_refused(amplifier: Amplifier, told: str) -> None:
    limits = Limits(**{**LIMITS.__dict__, "amplifier": amplifier})
    with pytest.raises(LimitExceeded, match=told):
        DRIVE.checked(limits)


def test_a_drive_that_is_a_hair_too_strong_is_told_from_the_limit() -> None:
    drive = replace(DRIVE, voltage_v=LIMITS.max_voltage_v + 1e-7)
    with pytest.raises(LimitExceeded, match=r"voltage_v must .*got \d+\.0000001$"):
        drive.checked(LIMITS)


def test_a_generator_without_a_known_gain_is_not_touched() -> None:
    port = ScriptedPort({})
    limits = Limits(**{**LIMITS.__dict__, "amplifier": Amplifier()})
    with pytest.raises(LimitExceeded, match=r"needs rig\.amplifier_gain"):
        Keysight(Link(port, monotonic=ticking()), limits).arm()
    assert port.sent == []


def test_a_ramp_moves_at_its_rate_and_ends_at_its_end() -> None:
    down = Ramp(from_v=100, to_v=20, begin_s=5, v_per_s=40)
    assert [down.at(now_s) for now_s in (5, 6, 6.5, 7, 100)] == [100, 60, 40, 20, 20]


class Generator(ScriptedPort):
    """A 33500 that keeps what it is told."""

    def __init__(self) -> None:
        super().__init__({b"*IDN?\n": b"Agilent Technologies,33522B,MY1,3\n"})
        self.kept = {"OUTP1:LOAD": "50", "SOUR1:VOLT:UNIT": "VRMS", "OUTP": "0", "OUTP1": "0"}

    def send(self, data: bytes) -> None:
        super().send(data)
        answers = []
        for command in data.decode().strip().split(";"):
            header, _, value = command.lstrip(":").partition(" ")
            if value and not header.endswith("?"):
                self.kept[header] = {"INF": "9.9E37", "MIN": "0.002", "OFF": "0"}.get(value, value)
            elif header.endswith("?"):
                known = {"*OPC": "1", "SYST:ERR": '+0,"No error"'}
                answers.append(known.get(header[:-1], self.kept.get(header[:-1], "0")))
        if answers and data not in self.answers and data != b"*ESE?\n":
            self.pending += ";".join(answers).encode() + b"\n"


def test_the_order_of_set_up_is_the_one_that_is_safe() -> None:
    port = Generator()
    Keysight(Link(port, monotonic=ticking(1e-4)), LIMITS).arm()
    told = [line.decode().strip() for line in port.sent if b"?" not in line]
    wanted = [
        "OUTP OFF",
        *(f"SOUR1:{name}:STAT 0" for name in ("AM", "FM", "PM", "PWM", "FSK", "SWE", "BURS")),
        *("SOUR1:BPSK:STAT 0", "SOUR1:SUM:STAT 0", "SOUR1:FREQ:MODE CW", "SOUR1:COMB:FEED NONE"),
        "OUTP2 0",
        "SOUR1:VOLT:LIM:STAT 0",
        "OUTP1:LOAD INF",
        "SOUR1:VOLT:UNIT VPP",
        "SOUR1:VOLT MIN",
        "SOUR1:VOLT:OFFS 0",
        "SOUR1:VOLT:LIM:HIGH 6",
        "SOUR1:VOLT:LIM:LOW -6",
        "SOUR1:VOLT:LIM:STAT 1",
    ]
    assert [line for line in told if line in wanted][-len(wanted) + 1 :] == wanted[1:]
    assert told[0] == wanted[0]
    assert not any("ON" in line.split() for line in told)


def test_0_v_of_a_generator_is_off_and_too_little_is_refused() -> None:
    port = Generator()
    generator = Keysight(Link(port, monotonic=ticking(1e-4)), LIMITS)
    generator.arm()
    port.sent.clear()
    still = Setpoint(voltage_v=0, frequency_hz=1000, ramp_v_per_s=100)
    assert generator.drive(still).output is False
    generator.least_v = 0.02
    with pytest.raises(LimitExceeded, match=r"0 or at least the generator's 0.02, got 0.01"):
        generator.drive(Setpoint(voltage_v=0.01, frequency_hz=1000, ramp_v_per_s=100))
    assert not any(b"ON" in line for line in port.sent)


def test_a_generators_ramp_goes_on_while_its_frequency_is_stepped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    generator = Keysight(Link(ScriptedPort({}), monotonic=ticking()), LIMITS)
    now_s = 0.0
    for name in ("_set_frequency", "_set_vpp", "send"):
        monkeypatch.setattr(generator, name, lambda *_: None)
    monkeypatch.setattr(generator, "read_back", lambda: replace(ON, frequency_hz=1000.0))
    monkeypatch.setattr(generator, "monotonic", lambda: now_s)
    generator.least_v = 0.0
    for step in range(21):
        now_s = 0.1 * step
        if step % 2:
            generator.carry_on()
        generator.drive(Setpoint(voltage_v=100, frequency_hz=1000 + step, ramp_v_per_s=50))
    generator.carry_on()
    assert generator.amplitude_v == pytest.approx(100)


LEAST_V = {
    "board": 100.0,
    "keysight": 0.02,
    "keysight-33220A": 0.2,
    "rigol": 0.04,
    "rigol-DG1062Z": 0.02,
    "siglent": 0.04,
}


@pytest.mark.parametrize("dialect", LEAST_V)
def test_a_rig_ramps_whatever_it_speaks(dialect: str) -> None:
    driver = dialect.split("-", maxsplit=1)[0]
    with (
        simulator_process(TOUCHBEAM, seed=1, dialect=dialect) as endpoints,
        ControlClient(endpoints.control) as control,
        opened(endpoints.url, driver) as rig,
    ):
        rig.arm()
        first = rig.drive(DRIVE)
        assert first.voltage_v == pytest.approx(LEAST_V[dialect]), "a board ramps by itself"

        def settled() -> bool:
            rig.beat()
            return bool(control.state()["voltage_v"] == pytest.approx(100))

        assert control.state()["voltage_v"] < 100, "it starts low"
        assert until(settled, within_s=3)
        assert rig.read_back().voltage_v == pytest.approx(100)
        assert control.state()["frequency_hz"] == DRIVE.frequency_hz
        rig.drive(replace(DRIVE, frequency_hz=24_400))
        assert control.state()["frequency_hz"] == 24_400
        rig.off()
        state = control.state()
        assert (state["output"], state["voltage_v"]) == (False, 0)
