"""A result as a file: whole or not at all, and nothing of the user's is touched."""

import os
import resource
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.whole_file import is_stream, write_whole


def entries(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_new_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "other").write_bytes(b"")
    write_whole(tmp_path / "new", b"data")
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "other").stat().st_mode
    assert entries(tmp_path) == ["new", "other"]


def test_a_file_of_the_user_beside_it_stays(tmp_path: Path) -> None:
    (tmp_path / "x.csv.part").write_text("mine")
    write_whole(tmp_path / "x.csv", b"data")
    assert (tmp_path / "x.csv.part").read_text() == "mine"


def test_what_was_there_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("old")
    path.chmod(0o640)
    write_whole(path, b"new")
    assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("new", 0o640)


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_followed(tmp_path: Path, there: bool) -> None:
    link, target = tmp_path / "link", tmp_path / "target"
    if there:
        target.write_text("old")
    link.symlink_to("target")
    write_whole(link, b"new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_a_long_name_is_no_hindrance(tmp_path: Path) -> None:
    write_whole(tmp_path / ("x" * 255), b"new")
    assert entries(tmp_path) == ["x" * 255]


@pytest.mark.parametrize("name", ["file/x.csv", "missing/x.csv", "x" * 256, "loop"])
def test_what_cannot_be_written_is_called_as_it_was_given(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "loop").symlink_to("loop")
    before = entries(tmp_path)
    with pytest.raises(OSError, match=name) as failed:
        write_whole(tmp_path / name, b"data")
    assert failed.value.filename == str(tmp_path / name)
    assert entries(tmp_path) == before


def test_a_file_too_large_for_the_disk_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("old")
    program = (
        "from pathlib import Path; from analysis.whole_file import write_whole as w; import sys"
    )
    said = subprocess.run(
        [sys.executable, "-c", f"{program}; w(Path(sys.argv[1]), bytes(99_999))", str(path)],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[2],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (9_999, 9_999)),
    )
    assert said.stderr.endswith(f"OSError: [Errno 27] File too large: '{path}'\n")
    assert (path.read_text(), entries(tmp_path)) == ("old", ["x.csv"])


def test_streams_are_told_from_files(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_text("")
    (tmp_path / "link").symlink_to("file")
    with (tmp_path / "file").open() as opened:
        (tmp_path / "descriptor").symlink_to(f"/dev/fd/{opened.fileno()}")
        found = {
            name: is_stream(tmp_path / name) for name in ("pipe", "file", "link", "descriptor")
        }
        assert is_stream(Path(f"/proc/self/fd/{opened.fileno()}"))
    assert found == {"pipe": True, "file": False, "link": False, "descriptor": True}
    assert is_stream(Path("/dev/null"))
    assert not is_stream(tmp_path / "missing")
