"""`touchbeam device`: list, probe, sweep, and the calibration that a sweep saves."""

import json
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import pytest

from device.errors import DeviceError, ForeignDevice
from device.link.link import Link
from device.resonance import Resonance
from device.simulator.client import ControlClient, Endpoints, Friction, simulator_process
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from protocol.errors import BadInput
from protocol.study.rig_settings import Rig as RigSettings
from protocol.study_file.loading import parsed_study, template
from runner.launch.device_access import answered, probed, session_rig, swept
from runner.study.calibration import keep_calibration, kept_calibration
from tests.device.rigs import DRIVE, TOUCHBEAM, opened
from tests.device.scripted import ScriptedPort, ticking
from tests.runner.command_line import typed

pytestmark = pytest.mark.waits

FOUND = Resonance(frequency_hz=24_180.5, tip_m_per_v=2e-8)


@dataclass(frozen=True)
class Done:
    """What a command in this process left."""

    returncode: int
    stdout: str
    stderr: str


def touchbeam(*arguments: str) -> Done:
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        code = typed(*arguments)
    return Done(code, out.getvalue(), err.getvalue())


HEALTH = {
    "board": ("1", "boot"),
    "keysight": ("1", "load_ohm"),
    "rigol": ("ON", "load_ohm"),
    "siglent": ("C1:OUTP ON,LOAD,HZ,PLRT,NOR", "wave"),
}
"""What a probe shows of an output that is on, and something else that it shows."""


@pytest.fixture(scope="module", params=HEALTH)
def endpoints(request: pytest.FixtureRequest) -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1, dialect=request.param, keep=True) as simulator:
        yield simulator


def test_a_probe_reports_identity_and_status_and_changes_nothing(endpoints: Endpoints) -> None:
    with ControlClient(endpoints.control) as control:
        control.fault("panel-on")
        said = probed(endpoints.url)
        output, other = HEALTH[said["dialect"]]
        assert said["output"] == output
        assert 0 < said["answer_ms"] < 400
        assert control.state()["output"] is True
        assert other in said


def test_a_question_that_a_device_does_not_know_has_no_answer_and_the_next_one_has() -> None:
    port = ScriptedPort({b"VOLT?\n": b"0\n", b"BOOT?\n": b"1\n"})
    link = Link(port, monotonic=ticking())
    asked = {query: answered(link, query) for query in ("VOLT?", "MEAS:TEMP?", "BOOT?")}
    assert asked == {"VOLT?": "0", "MEAS:TEMP?": None, "BOOT?": "1"}


def test_a_probe_of_an_unknown_device_shows_expected_and_actual_identity(
    endpoints: Endpoints,
) -> None:
    with ControlClient(endpoints.control) as control:
        control.fault("wrong-idn")
        with pytest.raises(ForeignDevice, match=r"TOUCHBEAM,BOARD.*33220A.*; got 'ACME,Toaster"):
            probed(endpoints.url)
        control.fault("wrong-idn", on=False)


def test_a_sweep_finds_the_hidden_resonance_and_saves_it(tmp_path: Path) -> None:
    (tmp_path / "study.toml").touch()
    done = touchbeam("device", "sweep", "sim", "--keep", str(tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    hidden_hz = SimulatedBeam(1).resonance_hz
    assert found["frequency_hz"] == pytest.approx(hidden_hz, rel=2e-4)
    kept = kept_calibration(tmp_path)
    assert kept is not None
    assert kept.frequency_hz == found["frequency_hz"] == found["resonance_hz"]
    highest_hz, _ = max(found["curve"], key=lambda point: point[1])
    assert len(found["curve"]) == 21
    assert highest_hz == pytest.approx(hidden_hz, rel=0.01)


def test_people_see_the_curve_and_units() -> None:
    swept_hz = touchbeam("device", "sweep", "sim").stdout.splitlines()
    assert re.fullmatch(r"23 010 Hz  [▁▂▃▄▅▆▇█]{21}  25 432 Hz", swept_hz[0])
    assert re.match(
        r"resonance 24 0\d\d Hz, \d\.\d nm per volt at the tip; device off", swept_hz[1]
    )
    probed_lines = touchbeam("device", "probe", "sim").stdout
    for line in ("output          off", "limit           200 V", "frequency       1 000 Hz"):
        assert line in probed_lines.splitlines()
    assert re.search(r"^answer          [\d.]+ ms$", probed_lines, re.MULTILINE)


def test_a_generator_uses_the_saved_calibration() -> None:
    settings = RigSettings(dialect="keysight", amplifier_gain=20.0, generator_max_vpp=20.0)
    with session_rig("sim", settings, 1, FOUND) as rig:
        rig.device.arm()
        assert rig.device.resonance(24_221.0, lambda _: None) == FOUND


@pytest.mark.parametrize("asked", ["board", "keysight"])
def test_a_generator_that_cannot_sweep_is_left_as_it_is(asked: str) -> None:
    """Whatever dialect it is said to have; its output, which is on here, is not touched."""
    with (
        simulator_process(TOUCHBEAM, seed=1, dialect="keysight", keep=True) as simulator,
        ControlClient(simulator.control) as control,
    ):
        control.fault("panel-on")
        done = touchbeam("device", "sweep", simulator.url, "--dialect", asked)
        assert control.state()["output"] is True
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "a keysight device measures no vibration: find the resonance another" in done.stderr
    assert "nothing was set, the output is as it was" in done.stderr
    with pytest.raises(BadInput, match="a rigol device measures no vibration"):
        swept("sim", 24_221.0, "rigol")


@pytest.mark.parametrize("dialect", ["board", "keysight", "rigol", "siglent"])
def test_a_person_at_a_simulated_device_with_an_address_makes_a_rehearsal(
    tmp_path: Path, dialect: str
) -> None:
    study = tmp_path / "study"
    assert touchbeam("new", str(study)).returncode == 0
    rig = f'dialect = "{dialect}"\namplifier_gain = 20\ngenerator_max_vpp = 20\n'
    text = (study / "study.toml").read_text(encoding="utf-8")
    text = text.replace("[rig]\n", f"[rig]\n{rig}", 1)
    (study / "study.toml").write_text(text, encoding="utf-8")
    keep_calibration(study, FOUND, "x", "2026-01-01")
    with simulator_process(TOUCHBEAM, seed=1, dialect=dialect, keep=True) as simulator:
        person = ("--participant", "P01", "--ratings", "console", "--consent", "C-1")
        done = touchbeam("run", str(study), *person, "--device", simulator.url)
    assert done.returncode == 2
    assert re.search(r"the device at .* is simulated \(.*,SIM,.*add --rehearsal", done.stderr)
    assert not (study / "study.db").exists()


def test_a_sweep_without_a_resonance_fails(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="no resonance between 13300 and 14700 Hz"):
        swept("sim", 14_000.0, "board")


def test_an_invalid_calibration_is_refused(tmp_path: Path) -> None:
    assert kept_calibration(tmp_path) is None
    with pytest.raises(BadInput, match="no study here"):
        keep_calibration(tmp_path, FOUND, "x", "2026-01-01")
    (tmp_path / "calibration.json").write_text('{"frequency_hz": "high"}')
    with pytest.raises(BadInput, match=r"\(frequency_hz must be a finite number, got 'high'\); "):
        kept_calibration(tmp_path)
    (tmp_path / "calibration.json").write_text('{"frequency_hz": -1, "tip_m_per_v": 1}')
    with pytest.raises(BadInput, match=r"frequency_hz must be above 0, got -1\.0"):
        kept_calibration(tmp_path)
    for tip in (0, -1e-8):
        (tmp_path / "calibration.json").write_text(
            json.dumps({"frequency_hz": 24221, "tip_m_per_v": tip})
        )
        with pytest.raises(
            BadInput, match=rf"tip_m_per_v must be above 0, got {float(tip)}; measure"
        ):
            kept_calibration(tmp_path)


def test_ports_are_listed_without_opening_any() -> None:
    done = touchbeam("device", "list", "--json")
    assert done.returncode == 0
    assert isinstance(json.loads(done.stdout), list)


@pytest.mark.parametrize(
    ("url", "code", "message"),
    [
        ("/dev/ttyNOPE", 1, "no such port; is the device plugged in?"),
        ("frob://x", 2, "not the address of a device"),
        (__file__, 2, "got a plain file"),
        ("/dev", 2, "got a plain folder"),
        ("socket://127.0.0.1:1", 1, "the connection was refused"),
        ("/dev/null", 1, "is not a serial port"),
        ("TCPIP0::192.168.1.50::inst0::INSTR", 2, "a VISA name; write socket://192.168.1.50:5025"),
        ("192.168.1.50", 2, "lacks the port; write socket://192.168.1.50:5025"),
        ("generator.local", 1, "; a device on the network is socket://generator.local:5025"),
    ],
)
def test_a_port_that_does_not_work_gives_one_line(url: str, code: int, message: str) -> None:
    done = touchbeam("device", "probe", url)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.count("\n") == 1
    assert message in done.stderr


@pytest.mark.parametrize("name", ["TCPIP0::10.0.0.9::inst0::INSTR", "10.0.0.9:5025", "10.0.0.9"])
def test_what_to_write_is_said_in_the_study_for_a_session_and_for_a_probe(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    for folder, device in (("study", "sim"), ("visa", name)):
        (tmp_path / folder).mkdir()
        text = template("paper").replace('device = "sim"', f'device = "{device}"')
        (tmp_path / folder / "study.toml").write_text(text, encoding="utf-8")
    person = ("--participant", "P01", "--ratings", "console")
    for command in (
        ("check", str(tmp_path / "visa")),
        ("run", str(tmp_path / "visa"), *person),
        ("run", str(tmp_path / "study"), *person, "--device", name),
        ("device", "probe", name),
    ):
        assert typed(*command) == 2
        message = capsys.readouterr()
        assert message.out == ""
        assert message.err.count("\n") == 1
        assert name in message.err
        assert "; write socket://10.0.0.9:5025 (5555 in place of 5025 at a Rigol)" in message.err
    assert not list(tmp_path.glob("*/study.db"))


def test_a_telnet_port_is_answered_with_the_port_for_programs() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def greet() -> None:
            visitor, _ = listener.accept()
            with visitor:
                visitor.sendall(b"Welcome to the 33522A\r\n33522A> ")
                while line := visitor.recv(100):
                    visitor.sendall(line + b"Agilent Technologies,33522A,1,2\r\n33522A> ")

        telnet = threading.Thread(target=greet)
        telnet.start()
        url = f"socket://127.0.0.1:{listener.getsockname()[1]}"
        done = touchbeam("device", "probe", url)
        telnet.join()
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert re.search(r"(echoes commands|sends a prompt).*; a telnet port \(5024\) do", done.stderr)
    assert "use the one for programs, such as socket://HOST:5025 (5555 at Rigol)" in done.stderr


def test_an_older_study_with_such_a_name_is_still_read(tmp_path: Path) -> None:
    name = "TCPIP0::10.0.0.9::inst0::INSTR"
    text = template("paper").replace('device = "sim"', f'device = "{name}"')
    assert parsed_study(text).rig.device == name


def test_an_address_cannot_write_to_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    url = "spy:///dev/null?file=thesis.tex"
    Path("thesis.tex").write_text("a chapter")
    for folder, device in (("study", "sim"), ("hostile", url)):
        Path(folder).mkdir()
        text = template("paper").replace('device = "sim"', f'device = "{device}"')
        Path(folder, "study.toml").write_text(text, encoding="utf-8")
    person = ("--participant", "P01", "--ratings", "console", "--rehearsal")
    for command in (
        ("check", "hostile"),
        ("run", "hostile", *person),
        ("run", "study", *person, "--device", url),
        ("device", "probe", url),
        ("device", "sweep", url),
    ):
        assert typed(*command) == 2
        message = capsys.readouterr()
        assert message.out == ""
        assert message.err.count("\n") == 1
        assert "must be sim, a serial port such as /dev/ttyACM0 or COM3" in message.err
        assert "socket://HOST:PORT or rfc2217://HOST:PORT, without options" in message.err
    assert Path("thesis.tex").read_text() == "a chapter"
    assert not list(tmp_path.glob("*/study.db"))


def test_the_simulated_beam_obeys_the_law_the_rung_and_the_damping_asked_for(
    tmp_path: Path,
) -> None:
    felt = []
    worlds: tuple[Friction, ...] = (
        {"law": "consistent", "rung": "mode"},
        {"law": "coulomb", "rung": "mode"},
        {"law": "coulomb", "rung": None},
        {"law": "coulomb", "rung": None, "damping": 0.02},
    )
    for world in worlds:
        with (
            simulator_process(TOUCHBEAM, seed=1, keep=True, **world) as simulator,
            ControlClient(simulator.control) as control,
            opened(simulator.url) as rig,
        ):
            rig.arm()
            rig.drive(DRIVE)
            control.advance(1.0)
            felt.append(control.touch(0.5, 0.0414, "right"))
    assert len(set(felt)) == len(worlds)
    done = touchbeam("simulate-device", "tcp", "0", "--rung", "highest")
    assert done.returncode == 2
    assert "rung must be one of eq15" in done.stderr
    done = touchbeam("simulate-device", "tcp", "0", "--damping", "2")
    assert done.returncode == 2
    assert "must lie strictly between 0 and 1, got '2'" in " ".join(done.stderr.split())
    study = str(tmp_path / "study")
    assert touchbeam("new", study).returncode == 0
    person = ("--participant", "P01", "--ratings", "console", "--rehearsal")
    done = touchbeam("run", study, *person, "--device", "/dev/ttyNONE", "--law", "coulomb")
    assert done.returncode == 2
    assert "--law, --rung and --damping are for --device sim, got /dev/ttyNONE" in done.stderr


def test_a_people_file_is_for_virtual_ratings_and_is_checked(tmp_path: Path) -> None:
    study, people = str(tmp_path / "study"), tmp_path / "people.toml"
    assert touchbeam("new", study).returncode == 0
    people.write_text("[person]\nlapse = 2\n[population]\nskin = 1\n")
    person = ("--participant", "P01", "--rehearsal", "--people", str(people))
    done = touchbeam("run", study, *person, "--ratings", "virtual")
    assert done.returncode == 2
    assert f"{people}:2: person.lapse: must be at most 1, got 2; " in done.stderr
    assert f"{people}:4: population.skin: must be one of" in done.stderr
    people.write_text("[person]\nlapse = 0.1\n")
    done = touchbeam("run", study, *person, "--ratings", "console")
    assert done.returncode == 2
    assert "--people is for --ratings virtual, got console" in done.stderr
    done = touchbeam("demo", "--out", str(tmp_path / "demo"), "--people", str(tmp_path / "none"))
    assert done.returncode == 2
    assert "none: no such file" in done.stderr
    assert not (tmp_path / "demo").exists()
