"""The command `power`: its document, what it keeps, and what it refuses."""

import errno
import json
import os
import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from analysis.report.drawing import Panel, panels_files
from protocol.study_file.loading import text_digest
from runner.study import files
from tests.runner.command_line import typed

FEW = ("--participants", "4", "--workers", "1")
QUICK = (*FEW, "--studies", "30", "--null-studies", "20", "--tests-only")


_DRAWN: dict[bytes, dict[str, bytes]] = {}


@pytest.fixture(autouse=True)
def drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures drawn before: the same one is not drawn again, which takes longer than all else."""

    def once(panels: Sequence[Panel], kinds: Sequence[str]) -> dict[str, bytes]:
        key = pickle.dumps((panels, kinds))
        if key not in _DRAWN:
            _DRAWN[key] = panels_files(panels, kinds)
        return _DRAWN[key]

    monkeypatch.setattr("analysis.power.power_report.panels_files", once)


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert typed("new", tmp_path / "mine") == 0
    capsys.readouterr()
    return tmp_path / "mine"


def document(folder: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    assert typed("power", folder, *options, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.usefixtures("figures_as_svg")
def test_the_document_has_what_others_rely_on(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = document(folder, capsys, *FEW, "--studies", "2", "--null-studies", "20", "--seed", "3")
    assert (found["studies"], found["seed"], found["workers"]) == (2, 3, 1)
    assert found["study_sha256"] == text_digest((folder / "study.toml").read_text("utf-8"))
    assert found["design"] == {
        "participants": 4,
        "repeats": 1,
        "levels": 1,
        "sessions": 1,
        "conditions": ["frequency", "structure", "voltage", "direction", "pressure"],
    }
    assert {"any_supported", "mc_error"} <= dict(found["null"]).keys()
    tests, estimates = found["tests"], found["estimates"]
    assert isinstance(tests, list)
    assert isinstance(estimates, list)
    assert [test["name"] for test in tests[:3]] == [
        "conditions differ",
        "gains differ",
        "frequency - structure",
    ]
    assert all({"power", "mc_error"} <= test.keys() for test in tests)
    wanted = {"name", "bias", "rmse", "coverage", "width", "type_s", "type_m", "mc_error"}
    assert all(wanted <= estimate.keys() for estimate in estimates)
    assert "M2 relative gain" in [estimate["name"] for estimate in estimates]
    assert str(found["answer"]).startswith("4 participants x 1 repeat: relative gains to within ±")
    names = {path.name for path in (folder / "power").iterdir()}
    assert names == {
        *("power.json", "power.svg", "power.png"),
        *("calibration.svg", "calibration.png", "chunks"),
    }


@pytest.mark.usefixtures("figures_as_svg")
def test_only_time_and_workers_depend_on_the_machine(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = document(folder, capsys, *QUICK)
    kept = (folder / "power" / "power.json").read_bytes()
    second = document(folder, capsys, *QUICK)
    for found in (first, second):
        found.pop("elapsed_s")
        found.pop("workers")
    assert first == second
    assert json.loads(kept) == first


def test_several_designs_make_a_curve(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--participants", "4,8", "--repeats", "1,2", "--studies", "30", "--tests-only")
    found = document(folder, capsys, *options, "--workers", "1")
    designs = found["designs"]
    assert isinstance(designs, list)
    sizes = [(each["design"]["participants"], each["design"]["repeats"]) for each in designs]
    assert sizes == [(4, 1), (4, 2), (8, 1), (8, 2)]
    assert found["design"] == designs[0]["design"]
    assert "design" in str(found["answer"])
    power = [each["tests"][0]["power"] for each in designs]
    assert power[0] < power[-1]


def test_people_read_tables_and_an_answer(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("power", folder, *QUICK) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "Tests: 4 participants x 1 repeat" in out
    assert "conditions differ" in out
    assert "Simulated: 30 studies, 20 without any effect." in out
    assert out.index("power to tell that") < out.index("Tests: 4"), "the answer stands first"
    assert "power to tell that the conditions differ" in out


def test_thresholds_are_kept_and_told_with_the_power_for_hypotheses_on_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "mine"
    assert typed("new", folder, "--template", "threshold") == 0
    below = "Weber fraction of smallest amplitude below 0.9"
    few = ("--participants", "2,3", "--studies", "3", "--workers", "1")
    capsys.readouterr()
    first = document(folder, capsys, *few)
    assert "tests" not in first
    written = json.loads((folder / "power" / "power.json").read_text("utf-8"))
    assert written == {key: first[key] for key in ("study_sha256", "seed", "tracks")}
    chunks = {path: path.stat().st_ino for path in folder.glob("power/chunks/*/*-tracks-*")}
    assert len(chunks) == 2
    assert typed("register", folder, "--primary", below) == 0
    capsys.readouterr()
    found = document(folder, capsys, *few)
    assert [each["participants"] for each in found["tracks"]] == [2, 3]
    for each in found["tracks"]:
        assert [it["name"] for it in each.pop("registered")] == [below]
    assert found["tracks"] == first["tracks"]
    assert {path: path.stat().st_ino for path in chunks} == chunks
    assert json.loads((folder / "power" / "power.json").read_text("utf-8")) == written
    assert typed("power", folder, *few) == 0
    told = capsys.readouterr().out
    assert f"Registered, {below}: supported in" in told
    assert "Weber fraction shown below" in told


def test_a_registered_study_names_the_power_of_its_hypotheses(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = document(folder, capsys, *QUICK)
    assert "registered" not in first
    chosen = ("--primary", "voltage above structure", "--hypothesis", "gains differ")
    assert typed("register", folder, *chosen) == 0
    capsys.readouterr()
    found = document(folder, capsys, *QUICK)
    registered = dict(found["registered"])
    assert registered["primary"]["name"] == "voltage above structure"
    assert registered["primary"]["row"] == "structure - voltage"
    assert [each["name"] for each in registered["secondary"]] == ["gains differ"]
    assert registered["secondary"][0]["power"] <= registered["primary"]["power"]
    told = "power for the registered primary hypothesis, voltage above structure."
    assert str(found["answer"]).endswith(told)
    # The registration holds the digest of that file.
    assert "registered" not in json.loads((folder / "power" / "power.json").read_text())
    assert typed("register", folder, *chosen) == 0
    assert typed("power", folder, *QUICK) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "structure - voltage (registered, primary)" in out
    assert "gains differ (registered) " in out
    assert told in out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--participants", "nine"), "--participants must be whole numbers above 0 by commas"),
        (("--repeats", "1,0"), "--repeats must be whole numbers above 0 by commas"),
        (("--participants", "1"), r"participants must lie in [2, 1000], got 1"),
        (
            ("--participants", "9,1001"),
            "participants must lie in [2, 1000], got 1001; give other numbers with --participants",
        ),
        (
            ("--repeats", "30"),
            "9 participants x 30 repeats cannot be planned: repeats must be at most 20; give fewer",
        ),
        (
            ("--repeats", "4", "--levels", "5"),
            "levels must be at most repeats, so that each comes equally often; give fewer with",
        ),
        (("--levels", "9" * 5000), "--levels must be numbers of at most 9 digits, got a longer"),
        (("--scheduler", "nowhere"), "--scheduler must be an address such as tcp://HOST:8786"),
        (("--workers", "0"), "Invalid value for '--workers'"),
        (("--studies", "1"), "Invalid value for '--studies'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    message: str,
) -> None:
    assert typed("power", folder, *options) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1
    assert not (folder / "power").exists()


@pytest.mark.usefixtures("figures_as_svg")
def test_other_people_give_other_results(
    folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    keen, wrong = tmp_path / "keen.toml", tmp_path / "wrong.toml"
    keen.write_text("[person]\ngain = 9.0\nbias = 4.0\nrating_noise = 0.1\nfelt_noise = 0.01\n")
    wrong.write_text("[person]\ngian = 9.0\n")
    found = [document(folder, capsys, *QUICK, *more) for more in ((), ("--people", str(keen)))]
    power = [dict(each["tests"][0])["power"] for each in found]
    assert power[0] < power[1] == 1
    assert typed("power", folder, *QUICK, "--people", wrong) == 2
    assert "gian" in capsys.readouterr().err


def test_a_study_of_one_condition_has_nothing_to_tell_apart(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder / "study.toml"
    before, condition, *_ = file.read_text().split("[[condition]]")
    file.write_text(f"{before}[[condition]]{condition}")
    assert typed("power", folder) == 2
    assert "needs at least 2 conditions, got 1" in capsys.readouterr().err


def test_nobody_at_the_scheduler_s_address_is_a_failure(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("analysis.power.engine._ANSWER_WITHIN_S", 0.5)
    assert typed("power", folder, "--scheduler", "tcp://127.0.0.1:9") == 1
    assert "no Dask scheduler answers there" in capsys.readouterr().err


def test_a_disk_that_is_full_at_any_write_is_said_in_one_line_and_nothing_is_lost(
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = folder.with_name("whole")
    whole.mkdir()
    (whole / "study.toml").write_bytes((folder / "study.toml").read_bytes())
    assert typed("power", whole, *QUICK) == 0
    kept, left, create = 0, 0, files.create

    def full(path: Path, data: bytes, mode: int) -> None:
        nonlocal left
        left -= 1
        create(path, data if left >= 0 else data[:10], mode)
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(files, "create", full)
    for written in range(100):
        left = written
        capsys.readouterr()
        code = typed("power", folder, *QUICK)
        chunks = len(list((folder / "power").rglob("*.npy")))
        assert chunks >= kept
        assert not list(folder.rglob(".touchbeam-*"))
        kept, (out, err) = chunks, capsys.readouterr()
        if code == 0:
            break
        assert (code, out) == (1, "")
        assert "No space left on device" in err
        assert err.count("\n") == 1
    assert written > 2
    for name in ("power.json", "power.svg", "power.png"):
        assert (folder / "power" / name).read_bytes() == (whole / "power" / name).read_bytes()


def test_kept_results_need_no_scheduler(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("analysis.power.engine._ANSWER_WITHIN_S", 0.5)
    nobody = ("--scheduler", "tcp://127.0.0.1:9")
    first = document(folder, capsys, *QUICK)
    again = document(folder, capsys, *QUICK, *nobody)
    assert (first.pop("workers"), again.pop("workers")) == (1, 0)
    assert first.pop("elapsed_s") != again.pop("elapsed_s")
    assert first == again
    next((folder / "power" / "chunks").rglob("*.npy")).unlink()
    assert typed("power", folder, *QUICK, *nobody) == 1
    assert "no Dask scheduler answers there" in capsys.readouterr().err


@pytest.mark.usefixtures("figures_as_svg")
def test_a_pipe_among_the_kept_results_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("power", folder, *QUICK) == 0
    kept = min((folder / "power" / "chunks").rglob("*.npy"))
    kept.unlink()
    os.mkfifo(kept)
    capsys.readouterr()
    assert typed("power", folder, *QUICK) == 2
    assert f"{kept.name}: must be a file, got a pipe or a device" in capsys.readouterr().err


def test_results_that_a_stranger_has_kept_are_computed_anew(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "stranger"))
    assert typed("power", folder, *QUICK) == 0
    chunks = sorted((folder / "power" / "chunks").rglob("*.npy"))
    with chunks[0].open("r+b") as huge:
        huge.truncate(2**42)
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "mine"))
    monkeypatch.setenv("LOCALAPPDATA", "relative")
    capsys.readouterr()
    before = [path.stat().st_mtime_ns for path in chunks]
    assert typed("power", folder, *QUICK) == 0
    assert f"warning: {len(chunks)} kept results in " in capsys.readouterr().err
    chunks[0].write_bytes(b"")
    assert typed("power", folder, *QUICK) == 0
    assert "warning: 1 kept result in " in capsys.readouterr().err
    assert all(path.stat().st_mtime_ns > time for path, time in zip(chunks, before, strict=True))
    assert typed("power", folder, *QUICK) == 0
    assert capsys.readouterr().err == ""
    key = folder / "mine" / "touchbeam" / "power.key"
    assert key.stat().st_mode & 0o777 == 0o600
    key.write_bytes(b"")
    assert typed("power", folder, *QUICK) == 1
    assert "power.key: must have 32 bytes, got 0; delete it" in capsys.readouterr().err
