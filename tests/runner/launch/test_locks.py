"""Locks: one session per rig, and one process per session, at a time."""

import errno
import hashlib
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from protocol.study_file.loading import template
from runner.launch.locks import RigInUse, UnsafeFolder, rig_lock, session_lock
from tests.runner.command_line import everything, typed

HERE = rf"in use by .+ in {re.escape(str(Path.cwd()))} \(process {os.getpid()}\); end that"


@contextmanager
def started(study: Path, ending: str) -> Iterator[subprocess.Popen[str]]:
    """Start a process that locks a rig and a session of `study`, says so, and does `ending`."""
    program = (
        "import os, sys; from pathlib import Path; from runner.launch import locks\n"
        "locks.COMMON = Path.cwd().parent\n"
        "with locks.session_lock('P01/1', Path()), locks.rig_lock('/dev/test-rig', locks.COMMON):\n"
        f"    print('locked', flush=True); {ending}\n"
    )
    command = [sys.executable, "-c", program, "--participant", "P01"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=study, text=True, stdin=pipe, stdout=pipe) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "locked\n"
        yield process
        process.communicate("")


@pytest.fixture
def study(locks: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a study's folder; the folder of the locks is beside it."""
    monkeypatch.setattr("runner.launch.locks.COMMON", locks.parent)
    folder = locks.with_name("study")
    folder.mkdir()
    return folder


def test_a_second_session_learns_which_one_uses_the_rig(study: Path) -> None:
    with started(study, "sys.stdin.read()") as first:
        used = f"is in use by .* --participant P01 in {study} .process {first.pid}.; end that"
        with (
            pytest.raises(RigInUse, match=f"/dev/test-rig {used}"),
            rig_lock("/dev/test-rig", study.parent),
        ):
            pass
        with (
            pytest.raises(RigInUse, match=f"session P01/1 of {study} {used}"),
            session_lock("P01/1", study),
        ):
            pass
    with rig_lock("/dev/test-rig", study.parent), session_lock("P01/1", study):
        pass


@pytest.mark.parametrize("code", [errno.ENOLCK, errno.ENOSYS, errno.ESTALE, errno.EIO])
def test_a_file_system_without_locks_gives_one_line(
    study: Path, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a network's may be: no session starts that another one would not notice."""

    def flock(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("fcntl.flock", flock)
    (study / "study.toml").write_text(template("paper"), encoding="utf-8")
    before = everything(study)
    assert typed("run", study, "--participant", "P01", "--ratings", "virtual") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(r"cannot lock session P01/1 of .*; keep it on a local disk, or restart", line)
    assert everything(study) == before


@pytest.mark.parametrize("ending", ["os._exit(7)", "os.kill(os.getpid(), 9)", "pass"])
def test_the_files_of_a_lock_tell_nothing_about_a_participant(
    locks: Path, study: Path, ending: str
) -> None:
    with started(study, ending) as process:
        pass
    held = {path.name: path.read_text() for path in locks.iterdir()}
    assert set(held.values()) == ({"", str(process.pid)} if ending != "pass" else {""})
    place = study.stat()
    identity = f"session P01/1 of {place.st_dev}:{place.st_ino}".encode()
    for known in (identity, identity + b" "):
        name = hashlib.sha256(known).hexdigest()
        assert not any(name.startswith(Path(file).stem) for file in held)


def test_the_same_process_cannot_lock_a_rig_twice() -> None:
    with (
        rig_lock("/dev/test-rig-2"),
        pytest.raises(RigInUse, match=HERE),
        rig_lock("/dev/test-rig-2"),
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
            rig_lock(first),
            pytest.raises(RigInUse, match=HERE),
            rig_lock(second),
        ):
            pass
    with (
        rig_lock("socket://localhost:50251"),
        rig_lock("socket://localhost:50252"),
        rig_lock("socket://192.0.2.5:50251"),
        rig_lock("socket://[2001:db8::5]:50251"),
    ):
        pass


@pytest.mark.parametrize(
    "url", ["socket://127.0.0.1:port", "socket://", "socket://[bad:5025", "spy:///dev/x", ""]
)
def test_an_invalid_address_can_be_locked(url: str) -> None:
    with rig_lock(url), pytest.raises(RigInUse), rig_lock(url):
        pass


def test_the_lock_of_a_dead_process_is_released() -> None:
    program = (
        "import os\nfrom runner.launch.locks import rig_lock\n"
        "with rig_lock('/dev/test-rig-3'): os._exit(7)\n"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 7
    with rig_lock("/dev/test-rig-3"):
        pass


def test_a_session_is_locked_under_all_paths_of_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, other = tmp_path / "study", tmp_path / "other"
    study.mkdir()
    other.mkdir()
    (tmp_path / "link").symlink_to(study)
    with session_lock("P01/1", study):
        monkeypatch.setenv("TMPDIR", str(other))
        monkeypatch.setattr(tempfile, "tempdir", None)
        study.rename(tmp_path / "renamed")
        (tmp_path / "renamed").rename(study)
        with (
            pytest.raises(RigInUse, match=r"session P01/1 of .*study is " + HERE),
            session_lock("P01/1", tmp_path / "link"),
        ):
            pass
        with session_lock("P01/1", other), session_lock("P02/1", study):
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
        rig_lock("/dev/test-rig", locks.parent),
    ):
        pass
    assert not [path for path in locks.parent.rglob("*") if path.suffix in {".process", ".lock"}]


def test_the_folder_of_another_user_is_not_used(
    locks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    with (
        pytest.raises(UnsafeFolder, match=f"touchbeam-held-{other}: .* got a folder of another us"),
        rig_lock("/dev/test-rig", locks.parent),
    ):
        pass
    assert not locks.exists()


def test_the_runtime_folder_is_used_if_the_common_one_is_taken(
    locks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    with rig_lock("/dev/test-rig", locks.parent):
        monkeypatch.delenv("XDG_RUNTIME_DIR")
        with (
            pytest.raises(RigInUse, match=HERE),
            rig_lock("/dev/test-rig", locks.parent),
        ):
            pass
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    locks.chmod(0o777)
    with (
        rig_lock("/dev/test-rig", locks.parent),
        pytest.raises(RigInUse, match=HERE),
        rig_lock("/dev/test-rig", locks.parent),
    ):
        assert {path.suffix for path in (runtime / "touchbeam-held").iterdir()} == {
            ".process",
            ".lock",
        }
    runtime.chmod(0o777)
    with (
        pytest.raises(UnsafeFolder, match="a folder with mode 0777"),
        rig_lock("/dev/test-rig", locks.parent),
    ):
        pass


def _made(locks: Path, suffix: str) -> Path:
    """Return the file with `suffix` that locking a rig creates."""
    with rig_lock("/dev/test-rig", locks.parent):
        return next(locks.glob(f"*{suffix}"))


@pytest.mark.parametrize("put", [Path.symlink_to, Path.hardlink_to])
def test_the_holder_is_not_written_through_a_link(
    locks: Path, tmp_path: Path, put: Callable[[Path, Path], None]
) -> None:
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("a chapter")
    put(_made(locks, ".process"), thesis)
    with (
        rig_lock("/dev/test-rig", locks.parent),
        pytest.raises(RigInUse, match=HERE),
        rig_lock("/dev/test-rig", locks.parent),
    ):
        pass
    assert thesis.read_text() == "a chapter"


def test_the_holder_is_not_read_through_a_link(locks: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.process"
    other.write_text('{"holder": "another user", "process": 1}')
    with rig_lock("/dev/test-rig", locks.parent):
        holder_file = next(locks.glob("*.process"))
        holder_file.unlink()
        holder_file.symlink_to(other)
        with (
            pytest.raises(RigInUse, match="in use by another session"),
            rig_lock("/dev/test-rig", locks.parent),
        ):
            pass


def test_a_lock_that_is_a_link_changes_no_file(locks: Path, tmp_path: Path) -> None:
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("a chapter")
    lock = _made(locks, ".lock")
    lock.unlink(missing_ok=True)
    lock.symlink_to(thesis)
    with pytest.raises(OSError, match=lock.name), rig_lock("/dev/test-rig", locks.parent):
        pass
    assert thesis.read_text() == "a chapter"
