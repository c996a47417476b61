"""The tests that come with a new study: they pass, or report the problems of the study."""

import re
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest

from device.resonance import Resonance
from protocol.plan.plan import plan
from protocol.study.study_question import ANSWERS
from protocol.study_file.loading import (
    parsed_study,
    template,
    template_pictures,
    template_tests,
)
from runner.launch.device_access import SessionRig
from runner.launch.rehearsal import Rehearsal, rehearse
from runner.people.virtual_participant import VirtualParticipant
from runner.screens import Pacing, ask_change
from runner.study.calibration import keep_calibration
from tests.protocol.surfaces import SURFACES, study_files
from tests.runner.command_line import typed

OPTIONS = ("-q", "--color=no", "-p", "no:cacheprovider", "-p", "no:benchmark")
SUMMARY = "short test summary info"  # pytest shortens its lines unless CI is set
PAPER = template("paper")


@pytest.fixture(scope="module")
def study_text() -> str:
    """Return the paper's study in place of the file beside a study's own test."""
    return PAPER


@pytest.fixture(params=["", "true"], ids=["at a desk", "in CI"])
def where(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run pytest as it behaves at a desk, then as it behaves in continuous integration."""
    monkeypatch.setenv("CI", request.param)
    monkeypatch.delenv("BUILD_NUMBER", raising=False)


def study_in(folder: Path, text: str | bytes) -> None:
    content = text.encode() if isinstance(text, str) else text
    (folder / "study.toml").write_bytes(content)
    (folder / "test_study.py").write_text(template_tests(), encoding="utf-8")


def pytest_run(folder: Path, text: str | bytes) -> subprocess.CompletedProcess[str]:
    """Run plain pytest in a study's folder within this process, which has all that it imports."""
    study_in(folder, text)
    with redirect_stdout(StringIO()) as said, chdir(folder):
        code = pytest.main([*OPTIONS, "-p", "no:unraisableexception", "-p", "no:faulthandler"])
    for name in [path.stem for path in folder.glob("test_*.py")]:
        del sys.modules[name]
    return subprocess.CompletedProcess(OPTIONS, code, said.getvalue())


def test_a_new_study_passes_its_own_tests(tmp_path: Path) -> None:
    """In a process of their own, beside a folder with the name of one of touchbeam's packages."""
    (tmp_path / "analysis").mkdir()
    (tmp_path / "analysis" / "__init__.py").write_text("raise RuntimeError('shadowed')\n")
    study_in(tmp_path, PAPER)
    command = [str(Path(sys.executable).with_name("pytest")), *OPTIONS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "5 passed" in done.stdout


@pytest.mark.parametrize("name", SURFACES)
def test_a_study_with_pictures_and_tables_passes_its_own_tests(tmp_path: Path, name: str) -> None:
    files = {**study_files(name), **template_pictures("plate")}
    text = template("plate") if name == "stated" else str(files["study.toml"])
    for file, content in files.items():
        (tmp_path / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    done = pytest_run(tmp_path, text)
    assert done.returncode == 0, done.stdout


_ORDERS = """
def test_orders(cohort, registration, rehearsal):
    opened = rehearsal.events[0].payload
    assert opened["registration"] == registration.digest
    assert tuple(opened["sequence"]) == cohort[0].sequence
"""


def test_a_registered_study_is_tested_with_its_own_orders(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(PAPER, encoding="utf-8")
    assert typed("register", tmp_path) == 0
    (tmp_path / "test_orders.py").write_text(_ORDERS, encoding="utf-8")
    done = pytest_run(tmp_path, PAPER)
    assert "6 passed" in done.stdout, done.stdout
    file = tmp_path / "registration.toml"
    file.write_text(file.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    done = pytest_run(tmp_path, PAPER)
    assert "registration.toml: was changed after touchbeam register wrote it" in done.stdout
    assert "Traceback" not in done.stdout


@pytest.mark.usefixtures("where")
def test_a_broken_study_fails_with_its_problems(tmp_path: Path) -> None:
    text = (
        PAPER.replace("ramp_to_v = 200", "ramp_to_v = 201")
        .replace("watchdog_s", "watchdg_s")
        .replace("0.081]", "0.2]")
    )
    done = pytest_run(tmp_path, text)
    assert done.returncode == 1
    assert "study.toml:17: rig.watchdg_s: unknown key, got 'watchdg_s'; did you" in done.stdout
    assert "study.toml:79: condition voltage, touch 1: the amplitude must not" in done.stdout
    assert "study.toml:23: touch.path_m.1: must lie on the beam, which ends at 0.1" in done.stdout
    assert "Traceback" not in done.stdout
    assert "During handling" not in done.stdout
    assert "pydantic" not in done.stdout
    failures = done.stdout.partition(SUMMARY)[0]
    assert failures.count("rig.watchdg_s") == 1, "reported once, not for every test"
    assert failures.count("the study cannot be used: see above") == 4
    assert "5 errors in" in done.stdout
    assert "passed" not in done.stdout


def test_a_byte_order_mark_is_accepted_as_in_check(
    tmp_path: Path,
) -> None:
    done = pytest_run(tmp_path, b"\xef\xbb\xbf" + PAPER.encode())
    assert done.returncode == 0, done.stdout
    assert "5 passed" in done.stdout


_LINE = PAPER.partition("paper")[0].count("\n") + 1


@pytest.mark.usefixtures("where")
@pytest.mark.parametrize(
    ("content", "why"),
    [
        (
            PAPER.encode().replace(b"paper", b"\xff", 1),
            f"cannot be read as UTF-8 text at line {_LINE}; save the file as UTF-8",
        ),
        (b"[study]\nname = ,", "study.toml:2: file: must be TOML, got the line 'name = ,'"),
    ],
)
def test_an_unreadable_file_is_reported_in_one_line(
    tmp_path: Path, content: bytes, why: str
) -> None:
    done = pytest_run(tmp_path, content)
    assert done.returncode == 1
    assert done.stdout.partition(SUMMARY)[0].count(why) == 1
    assert "5 errors in" in done.stdout
    for noise in ("Traceback", "During handling", "direct cause", "passed"):
        assert noise not in done.stdout


def test_a_study_for_a_generator_is_rehearsed_with_its_calibration(tmp_path: Path) -> None:
    rig = 'dialect = "keysight"\namplifier_gain = 40\ngenerator_max_vpp = 10'
    text = PAPER.replace('device = "sim"', f'device = "sim"\n{rig}')
    assert "write it to calibration.json" in pytest_run(tmp_path, text).stdout
    measured = Resonance(frequency_hz=24_150.0, tip_m_per_v=1e-8)
    keep_calibration(tmp_path, measured, "KEYSIGHT", "2026-01-01T00:00:00Z")
    done = pytest_run(tmp_path, text)
    assert done.returncode == 0, done.stdout


def test_the_examples_of_the_documentation_pass(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "study-tests.md").read_text(encoding="utf-8")
    examples = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(examples) == 2
    (tmp_path / "test_driving.py").write_text(examples[1], encoding="utf-8")
    done = pytest_run(tmp_path, PAPER)
    assert "6 passed" in done.stdout


def test_the_rehearsal_is_a_whole_session(rehearsal: Rehearsal) -> None:
    rehearsal.assert_complete()
    assert rehearsal.answers.keys() == {trial.index for trial in rehearsal.plan.trials}
    assert 195 < rehearsal.largest_voltage_v <= 200


def test_an_incomplete_session_fails(rehearsal: Rehearsal) -> None:
    lost = [event for event in rehearsal.events if event.payload.get("index") != 3]
    state = replace(rehearsal.state, answers=dict.fromkeys((0, 1, 2, 4, 5, 6), ""))
    with pytest.raises(AssertionError, match=r"got 6 answers to 7 trials; missing \[3\]"):
        replace(rehearsal, events=tuple(lost), state=state).assert_complete()
    on = [event for event in rehearsal.events if event.tag != "device-off"]
    with pytest.raises(AssertionError, match=r"device off, got 'completed', off confirmed: \[\]"):
        replace(rehearsal, events=tuple(on)).assert_complete()


def test_a_virtual_participant_feels_the_beam_at_rest(
    simulated_rig: SessionRig, virtual_participant: VirtualParticipant
) -> None:
    assert simulated_rig.device.read_back().voltage_v == 0
    for _ in range(2):
        virtual_participant.show(
            Pacing(start_m=0.04, end_m=0.04, duration_s=1.0, force_n=0.5, direction="right")
        )
        virtual_participant.clock.sleep(1.0)
        assert virtual_participant.poll() is None
    virtual_participant.show(ask_change("places"))
    response = virtual_participant.poll()
    assert response is not None
    assert response.answer in ANSWERS["places"]


def test_a_study_with_all_features_can_be_rehearsed() -> None:
    """Catch, opposite and practice trials, breaks and levels work in a whole session."""
    text = template("extended")
    session = rehearse(text, plan(parsed_study(text), 0))
    session.assert_complete()
    assert set(session.answers) == set(range(29))


@pytest.mark.parametrize("table", ["pictures", "tables"])
def test_a_strangers_study_names_no_file_outside_its_folder(tmp_path: Path, table: str) -> None:
    folder = tmp_path / "deep" / "study"
    folder.mkdir(parents=True)
    end = "png" if table == "pictures" else "csv"
    (tmp_path / f"taken.{end}").write_text("x", encoding="utf-8")
    text = f'{PAPER}\n[{table}]\n"../../taken.{end}" = "0f"\n'
    done = pytest_run(folder, text)
    assert done.returncode != 0
    assert "in the study's folder, such as" in done.stdout
    assert typed("check", folder) == 2
