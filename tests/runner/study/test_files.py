"""Files and folders are written completely or not at all, and never over something else."""

import os
import resource
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from protocol.errors import BadInput
from runner.study.files import is_stream, write_files, write_new_folder, write_whole
from tests.runner.command_line import TOUCHBEAM

CONTENTS = {"README.md": "触觉\n".encode(), "sub-1/beh/a.tsv": b"a\tb\n"}


def everything(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def assert_private(folder: Path) -> None:
    places = [folder, *folder.rglob("*")]
    modes = {str(place): oct(place.stat().st_mode & 0o777) for place in places}
    assert modes == {str(place): "0o700" if place.is_dir() else "0o600" for place in places}


@pytest.fixture(params=[0o000, 0o022, 0o077], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[None]:
    before = os.umask(request.param)
    yield
    os.umask(before)


@pytest.mark.usefixtures("umask")
def test_new_folders_and_files_are_for_their_owner_alone(tmp_path: Path) -> None:
    write_files({"figures/a": b"", "page": b""}, tmp_path / "report")
    write_new_folder({"sub-1/ses-1/beh/a": b"", "b": b""}, tmp_path / "export")
    for name in ("report", "export"):
        assert_private(tmp_path / name)


def test_a_report_that_its_owner_shares_stays_shared(tmp_path: Path) -> None:
    write_files({"page": b"old"}, tmp_path / "report")
    (tmp_path / "report").chmod(0o755)
    (tmp_path / "report/page").chmod(0o644)
    write_files({"page": b"new"}, tmp_path / "report")
    assert (tmp_path / "report").stat().st_mode & 0o777 == 0o755
    assert (tmp_path / "report/page").stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("name", ["new", "deep/new", "empty"])
def test_the_folder_contains_the_files_and_nothing_else(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    write_new_folder(CONTENTS, tmp_path / name)
    written = {f"{name}/{path}": data for path, data in CONTENTS.items()}
    assert everything(tmp_path) == written
    assert_private(tmp_path / name)


def test_a_folder_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(
        BadInput, match=f"{tmp_path.name}: must be a new or empty folder, but it contains files"
    ):
        write_new_folder(CONTENTS, tmp_path)
    assert everything(tmp_path) == {"mine.txt": b"mine"}


def test_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadInput, match=r"mine\.txt: must be a new or empty folder, got a file"):
        write_new_folder(CONTENTS, tmp_path / "mine.txt")


def test_a_failure_half_way_leaves_nothing_behind(tmp_path: Path) -> None:
    clash = {"a": b"a file\n", "a/b": b"in a folder of the same name\n"}
    place = tmp_path / "deep" / "er" / "new"
    with pytest.raises(FileExistsError, match=f"File exists: '{place}'"):
        write_new_folder(clash, place)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_reported_for_the_folder_as_given(tmp_path: Path) -> None:
    place = tmp_path / "deep" / "new"
    program = f"""
from collections.abc import Iterator
from pathlib import Path
from runner.study.files import write_new_folder
write_new_folder({{"a": bytes(9_999)}}, Path({str(place)!r}))
"""
    shown = subprocess.run(
        [sys.executable, "-B", "-c", program],  # or a compiled module may be cut, too
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[3],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (9_000, 9_000)),
    )
    assert shown.stderr.endswith(f"OSError: [Errno 27] File too large: '{place}'\n")
    assert list(tmp_path.iterdir()) == []


def test_a_study_that_cannot_be_written_names_the_file_and_leaves_nothing(tmp_path: Path) -> None:
    shown = subprocess.run(
        [TOUCHBEAM, "new", "study"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (512, 512)),
    )
    assert (shown.returncode, shown.stdout) == (1, "")
    assert shown.stderr == "touchbeam: study/study.toml: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_a_long_folder_name_is_accepted(tmp_path: Path) -> None:
    write_new_folder(CONTENTS, tmp_path / ("x" * 255))
    assert [path.name for path in tmp_path.iterdir()] == ["x" * 255]


def test_files_replace_those_of_an_earlier_call_and_no_others(
    tmp_path: Path,
) -> None:
    write_files({"page": b"old", "figures/a": b"old", "figures/b": b"old"}, tmp_path / "deep/er")
    (tmp_path / "deep/er/mine").write_text("mine")
    earlier = ("figures/a", "figures/b")
    write_files({"page": b"new", "figures/a": b"new"}, tmp_path / "deep/er", replaced=earlier)
    assert everything(tmp_path / "deep/er") == {
        "page": b"new",
        "figures/a": b"new",
        "mine": b"mine",
    }


def test_no_folder_is_made_for_files_that_are_only_to_be_removed(tmp_path: Path) -> None:
    for _ in range(2):
        write_files({"page": b""}, tmp_path / "report", replaced=("figures/a", "figures/b"))
        assert entries(tmp_path / "report") == ["page"]


def test_a_link_in_place_of_a_folder_of_replaced_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "figures").symlink_to(tmp_path / "nowhere")
    with pytest.raises(BadInput, match="figures: touchbeam writes here and follows no link"):
        write_files({"page": b""}, tmp_path / "report", replaced=("figures/a",), study=tmp_path)
    assert entries(tmp_path / "report") == ["figures"]


def test_a_path_that_cannot_be_a_folder_or_file_gets_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError, match=r"Not a directory: .*file/report"):
        write_files({"page": b""}, tmp_path / "file" / "report")
    with pytest.raises(NotADirectoryError, match=r"Not a directory: .*file'"):
        write_files({"page": b""}, tmp_path / "file")
    (tmp_path / "taken" / "figures").mkdir(parents=True)
    with pytest.raises(BadInput, match="page: must be a file, got a folder"):
        write_files({"figures/a": b"", "page/a": b"", "page": b""}, tmp_path / "new")
    assert everything(tmp_path) == {"file": b""}
    assert entries(tmp_path) == ["file", "taken"]


def entries(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_new_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "other").write_bytes(b"")
    write_whole(tmp_path / "new", b"data")
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "other").stat().st_mode
    assert entries(tmp_path) == ["new", "other"]


def test_a_users_file_beside_it_is_kept(tmp_path: Path) -> None:
    (tmp_path / "x.csv.part").write_text("mine")
    write_whole(tmp_path / "x.csv", b"data")
    assert (tmp_path / "x.csv.part").read_text() == "mine"


def test_an_existing_file_keeps_its_permissions(tmp_path: Path) -> None:
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


def test_a_long_file_name_is_accepted(tmp_path: Path) -> None:
    write_whole(tmp_path / ("x" * 255), b"new")
    assert entries(tmp_path) == ["x" * 255]


@pytest.mark.parametrize("name", ["file/x.csv", "missing/x.csv", "x" * 256, "loop"])
def test_a_write_error_names_the_path_as_given(tmp_path: Path, name: str) -> None:
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
        "from pathlib import Path; from runner.study.files import write_whole as w; import sys"
    )
    shown = subprocess.run(
        [sys.executable, "-B", "-c", f"{program}; w(Path(sys.argv[1]), bytes(99_999))", str(path)],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[3],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (9_999, 9_999)),
    )
    assert shown.stderr.endswith(f"OSError: [Errno 27] File too large: '{path}'\n")
    assert (path.read_text(), entries(tmp_path)) == ("old", ["x.csv"])


def test_streams_are_distinguished_from_files(tmp_path: Path) -> None:
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
