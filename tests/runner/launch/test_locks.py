"""Locks: one session per rig, and one process per session, at a time."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from runner.launch.locks import RigInUse, UnsafeFolder, rig_lock, session_lock


def test_a_second_session_learns_which_one_uses_the_rig() -> None:
    program = (
        "from runner.launch.locks import rig_lock\n"
        "with rig_lock('/dev/test-rig', 'P02/1 of /study'): pass\n"
    )
    with rig_lock("/dev/test-rig", "P01/1 of /study"):
        second = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=False
        )
    assert "/dev/test-rig is in use by P01/1 of /study (process" in second.stderr
    with rig_lock("/dev/test-rig", "P03/1 of /study"):
        pass


def test_the_same_process_cannot_lock_a_rig_twice() -> None:
    with (
        rig_lock("/dev/test-rig-2", "first"),
        pytest.raises(RigInUse, match="in use by first"),
        rig_lock("/dev/test-rig-2", "second"),
    ):
        pass


def test_a_rig_is_locked_under_all_its_addresses(tmp_path: Path) -> None:
    (tmp_path / "by-id").symlink_to("/dev/test-rig-4")
    for first, second in [
        ("/dev/test-rig-4", str(tmp_path / "by-id")),
        ("socket://localhost:50251", "socket://127.0.0.1:50251"),
        ("socket://127.0.0.1:50251", "rfc2217://localhost:50251"),
        ("socket://127.0.0.1:50251", "socket://[::ffff:127.0.0.1]:50251"),
        ("socket://[::FFFF:7f00:1]:50251", "SOCKET://LOCALHOST:050251"),
        ("socket://[::1]:50251", "socket://localhost:50251"),
        ("socket://[0:0::1]:50251", "socket://127.1.0.1:50251"),
        ("socket://0.0.0.0:50251", "socket://[::]:50251"),
        ("socket://192.0.2.5:50251", "rfc2217://[::ffff:192.0.2.5]:50251"),
        ("socket://[2001:db8::5]:50251", "socket://[2001:DB8:0:0::5]:50251"),
    ]:
        with (
            rig_lock(first, "first"),
            pytest.raises(RigInUse, match="in use by first"),
            rig_lock(second, "second"),
        ):
            pass
    with (
        rig_lock("socket://localhost:50251", "one"),
        rig_lock("socket://localhost:50252", "two"),
        rig_lock("socket://192.0.2.5:50251", "three"),
        rig_lock("socket://[2001:db8::5]:50251", "four"),
    ):
        pass


@pytest.mark.parametrize(
    "url", ["socket://127.0.0.1:port", "socket://", "socket://[bad:5025", "spy:///dev/x", ""]
)
def test_an_invalid_address_can_be_locked(url: str) -> None:
    with rig_lock(url, "first"), pytest.raises(RigInUse), rig_lock(url, "second"):
        pass


def test_the_lock_of_a_dead_process_is_released() -> None:
    program = (
        "import os\nfrom runner.launch.locks import rig_lock\n"
        "with rig_lock('/dev/test-rig-3', 'dead'): os._exit(7)\n"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 7
    with rig_lock("/dev/test-rig-3", "alive"):
        pass


def test_a_session_is_locked_under_all_paths_of_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, other = tmp_path / "study", tmp_path / "other"
    study.mkdir()
    other.mkdir()
    (tmp_path / "link").symlink_to(study)
    with session_lock("P01/1", study, "the first"):
        monkeypatch.setenv("TMPDIR", str(other))
        monkeypatch.setattr(tempfile, "tempdir", None)
        study.rename(tmp_path / "renamed")
        (tmp_path / "renamed").rename(study)
        with (
            pytest.raises(RigInUse, match=r"session P01/1 of .*study is in use by the first"),
            session_lock("P01/1", tmp_path / "link", "the second"),
        ):
            pass
        with session_lock("P01/1", other, "another study"), session_lock("P02/1", study, "P02"):
            pass


@pytest.fixture
def locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the path of the folder of the locks in this test's own place; it does not exist."""
    if not hasattr(os, "getuid"):
        pytest.skip("Windows gives each user a temporary folder")
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    return tmp_path / f"touchbeam-held-{os.getuid()}"


def _linked(locks: Path) -> None:
    other = locks.with_name("other")
    other.mkdir(mode=0o700)
    locks.symlink_to(other)


def _open_to_all(locks: Path) -> None:
    locks.mkdir()
    locks.chmod(0o777)


@pytest.mark.parametrize(
    ("take", "found"),
    [
        (_linked, "a link"),
        (lambda locks: locks.symlink_to("nowhere"), "a link"),
        (_open_to_all, "a folder with mode 0777"),
        (Path.touch, "a file"),
    ],
)
def test_a_folder_that_others_can_write_to_is_refused(
    locks: Path, take: Callable[[Path], None], found: str
) -> None:
    take(locks)
    with (
        pytest.raises(UnsafeFolder, match=f"{locks}: must be a folder that only .* got {found}; "),
        rig_lock("/dev/test-rig", "first", locks.parent),
    ):
        pass
    assert not [path for path in locks.parent.rglob("*") if path.suffix in {".json", ".lock"}]


def test_the_folder_of_another_user_is_not_used(
    locks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    with (
        pytest.raises(UnsafeFolder, match=f"touchbeam-held-{other}: .* got a folder of another us"),
        rig_lock("/dev/test-rig", "first", locks.parent),
    ):
        pass
    assert not locks.exists()


def test_the_runtime_folder_is_used_if_the_common_one_is_taken(
    locks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    with rig_lock("/dev/test-rig", "first", locks.parent):
        monkeypatch.delenv("XDG_RUNTIME_DIR")
        with (
            pytest.raises(RigInUse, match="in use by first"),
            rig_lock("/dev/test-rig", "second", locks.parent),
        ):
            pass
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    locks.chmod(0o777)
    with (
        rig_lock("/dev/test-rig", "first", locks.parent),
        pytest.raises(RigInUse, match="in use by first"),
        rig_lock("/dev/test-rig", "second", locks.parent),
    ):
        assert {path.suffix for path in (runtime / "touchbeam-held").iterdir()} == {
            ".json",
            ".lock",
        }
    runtime.chmod(0o777)
    with (
        pytest.raises(UnsafeFolder, match="a folder with mode 0777"),
        rig_lock("/dev/test-rig", "first", locks.parent),
    ):
        pass


def _made(locks: Path, suffix: str) -> Path:
    """Return the file with `suffix` that locking a rig creates."""
    with rig_lock("/dev/test-rig", "first", locks.parent):
        return next(locks.glob(f"*{suffix}"))


@pytest.mark.parametrize("put", [Path.symlink_to, Path.hardlink_to])
def test_the_holder_is_not_written_through_a_link(
    locks: Path, tmp_path: Path, put: Callable[[Path, Path], None]
) -> None:
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("a chapter")
    put(_made(locks, ".json"), thesis)
    with (
        rig_lock("/dev/test-rig", "first", locks.parent),
        pytest.raises(RigInUse, match="in use by first"),
        rig_lock("/dev/test-rig", "second", locks.parent),
    ):
        pass
    assert thesis.read_text() == "a chapter"


def test_the_holder_is_not_read_through_a_link(locks: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    other.write_text('{"holder": "another user", "process": 1}')
    with rig_lock("/dev/test-rig", "first", locks.parent):
        holder_file = next(locks.glob("*.json"))
        holder_file.unlink()
        holder_file.symlink_to(other)
        with (
            pytest.raises(RigInUse, match="in use by another session"),
            rig_lock("/dev/test-rig", "second", locks.parent),
        ):
            pass


def test_a_lock_that_is_a_link_changes_no_file(locks: Path, tmp_path: Path) -> None:
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("a chapter")
    lock = _made(locks, ".lock")
    lock.unlink(missing_ok=True)
    lock.symlink_to(thesis)
    with pytest.raises(OSError, match=lock.name), rig_lock("/dev/test-rig", "first", locks.parent):
        pass
    assert thesis.read_text() == "a chapter"
