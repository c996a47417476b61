"""Kept results: private, in the user's own folder, of limited size, not believed if damaged."""

import json
import os
import pickle
import sqlite3
import zlib
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.kept import Kept
from analysis.loading import sessions
from analysis.report import report as reports
from analysis.sensitivity.linear_model import linear_sensitivity
from analysis.sensitivity.lines import Ratings
from analysis.statistics.additive import additive_effects, gain_heterogeneity
from analysis.statistics.summary import reading
from analysis.trials.contrasts import contrasts_by_law
from device.friction.changes import CONDITIONS, RUNG
from device.friction.scenes import NOMINAL
from protocol.errors import WorkFailed
from protocol.journal.events import StoredEvent
from runner.journal.opening import open_journal
from runner.study import kept_files
from runner.study.kept_files import KeptFiles, forget
from runner.study.kept_files import kept_files as kept_of
from tests.analysis.reports import study_report
from tests.runner.command_line import typed
from touchbeam.study import load

PUBLISHED = Path(__file__).parents[2] / "data" / "published_scores.csv"
SHORT = ("--sections", "table4,sensitivity")
"""Of a report that has fits to keep, and takes no longer than a test of what is kept needs."""
FELT = tuple((change, NOMINAL) for change in CONDITIONS.values())


class Never(Exception):
    """A call that was to be known."""


def never() -> None:
    raise Never


def calls() -> list[tuple[object, ...]]:
    table = study_report().loaded.table
    ratings: Ratings = study_report().trials.scored.ratings
    return [
        (linear_sensitivity, ratings),
        (reading, "missing", table),
        (additive_effects, table),
        (gain_heterogeneity, table),
        (contrasts_by_law, FELT, RUNG),
    ]


def found(keep: Kept) -> list[str]:
    return [repr(keep(*call)) for call in calls()]  # type: ignore[arg-type]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "all" / "study"


def test_what_is_kept_is_not_computed_again_and_nobody_else_can_read_it(folder: Path) -> None:
    first = found(Kept(KeptFiles(folder), "1"))
    again = Kept(KeptFiles(folder), "1")
    for function, *args in calls():
        again.made(never, function, tuple(args), {})  # type: ignore[arg-type]
    assert found(again) == first
    assert {path.stat().st_mode & 0o777 for path in folder.iterdir()} == {0o600}
    assert [place.stat().st_mode & 0o777 for place in (folder, folder.parent)] == [0o700] * 2
    function, *args = calls()[0]
    with pytest.raises(Never):
        Kept(KeptFiles(folder), "2").made(never, function, tuple(args), {})  # type: ignore[arg-type]


class Trap:
    """Read by pickle, it leaves a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return (os.mkdir, (str(self.path),))


def damage(path: Path, rng: np.random.Generator, others: list[Path], trap: Path) -> None:
    """Change a kept file in one of many ways."""
    content = bytearray(path.read_bytes())
    place = int(rng.integers(len(content)))
    match rng.integers(7):
        case 0:
            content[place] ^= 1 << int(rng.integers(8))
        case 1:
            del content[place:]
        case 2:
            content[place:place] = rng.bytes(9)
        case 3:
            content[:] = others[int(rng.integers(len(others)))].read_bytes()
        case 4:
            content[:] = rng.bytes(int(rng.integers(200)))
        case 5:
            content[:] = pickle.dumps(Trap(trap))
        case _:  # somebody who can write here, with a digest that is right
            name = ("posix.mkdir", "builtins.eval", "array", "mapping", "call", "function")
            given = [str(trap), "O", [1], "X"][: int(rng.integers(1, 4))]
            text = json.dumps({name[int(rng.integers(len(name)))]: given}).encode()
            packed = zlib.compress(text) if rng.integers(2) else pickle.dumps(Trap(trap))
            content[:] = kept_files._digest(path.name, packed) + packed
    path.write_bytes(content)


def assert_damage_changes_no_number(folder: Path, times: int, seed: int) -> None:
    rng, trap = np.random.default_rng(seed), folder.parent.parent / "executed"
    right = found(Kept(KeptFiles(folder)))
    paths = sorted(folder.iterdir())
    assert len(paths) == len(right)
    for _ in range(times):
        damage(paths[int(rng.integers(len(paths)))], rng, paths, trap)
        assert found(Kept(KeptFiles(folder))) == right
        assert not trap.exists()


def with_a_text_for_a_number(form: Any) -> Any:
    """Return the form of a result in which each list of two or more numbers has a text, too."""
    if isinstance(form, dict):
        return {kind: with_a_text_for_a_number(given) for kind, given in form.items()}
    if isinstance(form, list):
        changed = [with_a_text_for_a_number(each) for each in form]
        numbers = [at for at, each in enumerate(changed) if isinstance(each, float)]
        return [*changed[: numbers[0]], "x", *changed[numbers[0] + 1 :]] if numbers else changed
    return form


@pytest.mark.parametrize("wrong", [5, None, "x", {"tuple": [1.5]}, {"mapping": [["a", 1.5]]}, ...])
def test_a_result_of_another_type_is_computed_anew_and_replaced(
    folder: Path, wrong: object
) -> None:
    right = found(Kept(KeptFiles(folder)))
    kept = {path: path.read_bytes() for path in folder.iterdir()}
    for path, content in kept.items():
        form = json.loads(zlib.decompress(content[kept_files._DIGEST_BYTES :]))
        other = with_a_text_for_a_number(form) if wrong is ... else wrong
        packed = zlib.compress(json.dumps(other, separators=(",", ":")).encode(), level=1)
        path.write_bytes(kept_files._digest(path.name, packed) + packed)
    assert found(Kept(KeptFiles(folder))) == right
    assert {path: path.read_bytes() for path in folder.iterdir()} == kept


def test_a_damaged_result_is_computed_anew(folder: Path) -> None:
    assert_damage_changes_no_number(folder, 40, 1)


@pytest.mark.soak
def test_a_thousand_damages_change_no_number(folder: Path) -> None:
    assert_damage_changes_no_number(folder, 1000, 2)


def test_what_was_used_longest_ago_is_removed_when_there_is_too_much(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_files, "MOST_BYTES", 3000)
    files = KeptFiles(folder)
    for number in range(5):
        files.put(f"{number}", bytes(900))
        if (folder / f"{number}").exists():
            os.utime(folder / f"{number}", (number, number))
    assert sorted(path.name for path in folder.iterdir()) == ["2", "3", "4"]


@pytest.mark.parametrize("mode", [0o777, 0o555])
def test_where_nothing_can_be_kept_everything_is_computed(folder: Path, mode: int) -> None:
    folder.parent.mkdir()
    folder.parent.chmod(mode)
    if mode == 0o555 and os.geteuid() == 0:  # root can write anywhere: a file in its place
        folder.parent.rmdir()
        folder.parent.write_text("")
    assert len(found(Kept(KeptFiles(folder)))) == len(calls())
    assert not folder.exists()


def test_a_link_in_place_of_a_kept_file_is_not_followed(folder: Path, tmp_path: Path) -> None:
    files = KeptFiles(folder)
    files.put("a", b"1")
    (folder / "a").rename(tmp_path / "a")
    (folder / "a").symlink_to(tmp_path / "a")
    assert files.get("a") is None


def test_a_study_keeps_its_results_apart_and_a_withdrawal_removes_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache, study = tmp_path / "cache", tmp_path / "study"
    monkeypatch.setenv(kept_files.VARIABLE, str(cache))
    assert typed("import", PUBLISHED, study) == 0
    assert typed("report", study, *SHORT) == 0
    pages = [zlib.decompress(path.read_bytes()[32:]) for path in cache.glob("*/*")]
    assert any(b'"3"' in page for page in pages)
    assert typed("withdraw", study, "--participant", "3", "--yes") == 0
    assert [path.suffix for path in cache.rglob("*")] == [".withdrawn"]
    monkeypatch.setenv(kept_files.VARIABLE, kept_files.OFF)
    assert typed("report", study, *SHORT) == 0
    with open_journal(study / "study.db") as journal:
        assert kept_of(journal) is None
        monkeypatch.setenv(kept_files.VARIABLE, str(cache))
        assert forget(journal) is None
    assert [path.suffix for path in cache.rglob("*")] == [".withdrawn"]


def test_the_page_is_the_same_with_and_without_kept_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(kept_files.VARIABLE, str(tmp_path / "cache"))
    study = tmp_path / "study"
    assert typed("import", PUBLISHED, study) == 0
    made = []
    for options in ((), (), ("--sections", "sensitivity"), ()):
        assert typed("report", study, *options) == 0
        files = (path for path in (study / "report").iterdir() if path.is_file())
        made.append({path.name: path.read_bytes() for path in files})
    assert made[0] == made[1] == made[3]


def test_a_journal_as_it_was_is_not_read_again_and_another_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(kept_files.VARIABLE, str(tmp_path / "cache"))
    study = tmp_path / "study"
    opened: list[int] = []
    assert typed("import", PUBLISHED, study) == 0
    capsys.readouterr()
    assert typed("report", study, *SHORT, "--out", tmp_path / "a") == 0
    said = capsys.readouterr().out
    load = sessions.load_sessions

    def loaded(chains: Iterable[Sequence[StoredEvent]]) -> sessions.Sessions:
        opened.append(1)
        return load(chains)

    monkeypatch.setattr(sessions, "load_sessions", loaded)
    assert typed("report", study, *SHORT, "--out", tmp_path / "b") == 0
    assert capsys.readouterr().out == said.replace(str(tmp_path / "a"), str(tmp_path / "b"))
    assert opened == []
    assert (tmp_path / "a" / "report.html").read_bytes() == (
        tmp_path / "b" / "report.html"
    ).read_bytes()
    assert typed("exclude", study, "--participant", "3", "--reason", "late") == 0
    assert typed("report", study, *SHORT, "--out", tmp_path / "b") == 0
    assert opened == [1]
    assert "Left out: 3" in capsys.readouterr().out
    with sqlite3.connect(study / "study.db") as journal:
        journal.execute("DROP TRIGGER event_is_erased_at_most")
        journal.execute("UPDATE event SET utc = replace(utc, '20', '19')")
    journal.close()
    assert typed("report", study, *SHORT, "--out", tmp_path / "b") != 0


def test_a_journal_that_was_read_is_not_read_again_by_another_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(kept_files.VARIABLE, str(tmp_path / "cache"))
    study = tmp_path / "study"
    assert typed("import", PUBLISHED, study) == 0
    first = load(study)
    load_sessions = sessions.load_sessions

    def never_loaded(_: Iterable[Sequence[StoredEvent]]) -> sessions.Sessions:
        raise Never

    import_module("analysis.export.dataset")  # a first import below would keep what replaces it
    monkeypatch.setattr(sessions, "load_sessions", never_loaded)
    assert load(study).trials.equals(first.trials)
    assert typed("report", study, *SHORT) == 0
    assert typed("export", study, tmp_path / "kept", "--format", "csv") == 0
    assert typed("exclude", study, "--participant", "3", "--reason", "late") == 0
    with pytest.raises(Never):
        load(study)
    monkeypatch.setattr(sessions, "load_sessions", load_sessions)
    assert load(study).sessions["exclusion_reason"].notna().sum() == 1
    monkeypatch.setenv(kept_files.VARIABLE, kept_files.OFF)
    assert typed("export", study, tmp_path / "read", "--format", "csv") == 0
    kept = (tmp_path / "kept" / "trials.csv").read_text()
    assert kept != (tmp_path / "read" / "trials.csv").read_text()


def test_commands_and_python_make_a_report_once_and_none_comes_back_after_a_withdrawal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache, study = tmp_path / "cache", tmp_path / "study"
    monkeypatch.setenv(kept_files.VARIABLE, str(cache))
    assert typed("import", PUBLISHED, study) == 0
    made: list[object] = []
    make = reports.report

    def counted(*args: Any, **named: Any) -> reports.Report:
        made.append(named)
        return make(*args, **named)

    monkeypatch.setattr(reports, "report", counted)
    assert typed("report", study, "--out", tmp_path / "a") == 0
    loaded = load(study)
    page = loaded.report(tmp_path / "b")
    assert len(made) == 1
    assert page.read_bytes() == (tmp_path / "a" / "report.html").read_bytes()
    loaded.report(tmp_path / "c", sections="sensitivity")
    assert typed("report", study, "--out", tmp_path / "d", "--sections", "sensitivity") == 0
    assert len(made) == 2
    assert typed("withdraw", study, "--participant", "3", "--yes") == 0
    with pytest.raises(WorkFailed, match="somebody withdrew meanwhile"):
        loaded.report(tmp_path / "e")
    assert not (tmp_path / "e").exists()
    assert [path.suffix for path in cache.rglob("*")] == [".withdrawn"]


def test_nobody_who_withdraws_meanwhile_is_in_a_report_or_in_what_is_kept_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cache, study = tmp_path / "cache", tmp_path / "study"
    monkeypatch.setenv(kept_files.VARIABLE, str(cache))
    assert typed("import", PUBLISHED, study) == 0
    make = reports.report

    def withdrawn(*args: Any, **named: Any) -> reports.Report:
        assert typed("withdraw", study, "--participant", "3", "--yes") == 0
        return make(*args, **named)

    monkeypatch.setattr(reports, "report", withdrawn)
    assert typed("report", study, *SHORT) != 0
    assert "somebody withdrew meanwhile" in capsys.readouterr().err
    assert not (study / "report").exists()
    assert [path for path in cache.glob("*/*") if path.is_file()] == []
    monkeypatch.setattr(reports, "report", make)
    assert typed("report", study, *SHORT) == 0
    assert list(cache.glob("*/*"))


def test_a_withdrawal_writes_through_no_link_where_others_can_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache, study, other = tmp_path / "cache", tmp_path / "study", tmp_path / "other"
    monkeypatch.setenv(kept_files.VARIABLE, str(cache))
    assert typed("import", PUBLISHED, study) == 0
    with open_journal(study / "study.db") as journal:
        assert forget(journal) is None
        (mark,) = cache.glob("*.withdrawn")
        mark.unlink()
        other.write_text("theirs")
        mark.symlink_to(other)
        cache.chmod(0o777)
        forget(journal)
    assert other.read_text() == "theirs"
