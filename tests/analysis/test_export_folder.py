"""An export is there as a whole or not at all, and never over something else."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.export_folder import write_new_folder
from protocol.errors import BadInput

CONTENTS = {"README.md": "触觉\n", "sub-1/beh/a.tsv": "a\tb\n"}


def everything(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.mark.parametrize("name", ["new", "deep/new", "empty"])
def test_the_folder_holds_the_contents_and_nothing_else(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    mode = (tmp_path / "empty").stat().st_mode
    write_new_folder(CONTENTS, tmp_path / name)
    written = {f"{name}/{path}": text.encode() for path, text in CONTENTS.items()}
    assert everything(tmp_path) == written
    assert (tmp_path / name).stat().st_mode == mode, "as readable as any new folder"


def test_a_folder_that_holds_something_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadInput, match=f"{tmp_path.name}: is there already and not empty"):
        write_new_folder(CONTENTS, tmp_path)
    assert everything(tmp_path) == {"mine.txt": b"mine"}


def test_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadInput, match=r"mine\.txt: is a file; name a folder to make"):
        write_new_folder(CONTENTS, tmp_path / "mine.txt")


def test_what_fails_on_the_way_leaves_nothing_behind(tmp_path: Path) -> None:
    clash = {"a": "a file\n", "a/b": "in a folder of the same name\n"}
    place = tmp_path / "deep" / "er" / "new"
    with pytest.raises(FileExistsError, match=f"File exists: '{place}'"):
        write_new_folder(clash, place)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_of_the_folder_that_was_named(tmp_path: Path) -> None:
    place = tmp_path / "deep" / "new"
    program = f"""
from pathlib import Path
from analysis.export_folder import write_new_folder
write_new_folder({{"a": 9_999 * " "}}, Path({str(place)!r}))
"""
    said = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[2],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (9_000, 9_000)),
    )
    assert said.stderr.endswith(f"OSError: [Errno 27] File too large: '{place}'\n")
    assert list(tmp_path.iterdir()) == []


def test_a_long_name_is_no_hindrance(tmp_path: Path) -> None:
    write_new_folder(CONTENTS, tmp_path / ("x" * 255))
    assert [path.name for path in tmp_path.iterdir()] == ["x" * 255]
