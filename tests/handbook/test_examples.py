"""Tutorials, how-to pages and the README: what they let a reader type does what they show."""

import re
import shutil
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import BytesIO, StringIO, TextIOWrapper
from pathlib import Path

import pytest

import touchbeam
from handbook.build import ROOT
from handbook.examples import Example, in_shell, run_page
from tests.runner.command_line import typed

PAGES = [
    *sorted((ROOT / "docs" / "tutorials").glob("*.md")),
    *sorted((ROOT / "docs" / "how-to").glob("*.md")),
    ROOT / "docs" / "cookbook.md",
    ROOT / "docs" / "annotated-study.md",
    ROOT / "README.md",
]


def here(command: str, folder: Path) -> str:
    """Run a command of touchbeam in this process, which has what it imports; others in a shell."""
    if not re.fullmatch(r"touchbeam [^|&;<>$*'\"]*", command):
        return in_shell(command, folder)
    printed = TextIOWrapper(BytesIO(), encoding="utf-8", write_through=True)
    with chdir(folder), redirect_stdout(printed), redirect_stderr(printed):
        code = typed(*command.split()[1:])
    said = printed.buffer.getvalue().decode().replace(str(folder), "/home/you")
    assert code == 0, said
    return said


# The README's are run by a shell, as a reader runs them.
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_examples_of_a_page_do_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Results that earlier versions kept for whoever runs this are no part of a page.
    monkeypatch.setattr("runner.study.old_results.old_caches", list)
    for name in ("DISPLAY", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.stdin", StringIO())
    shell = in_shell if page.stem == "README" else here
    for example in run_page(page.read_text(encoding="utf-8"), tmp_path, shell):
        assert example.agrees, f"run: python -m handbook.examples --write {page}\n{example}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_box_of_a_page_is_empty(page: Path) -> None:
    assert not re.search(r"^```\w+\n\s*```$", page.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.parametrize("name", ["how-to/script.md", "python.md"])
def test_what_a_page_names_of_the_rig_exists(name: str) -> None:
    named = re.findall(r"\brig\.(?!md\b)(\w+)", (ROOT / "docs" / name).read_text(encoding="utf-8"))
    assert [name for name in named if not hasattr(touchbeam.OpenRig, name)] == []
    assert "drive" in named


@pytest.mark.parametrize(
    ("shown", "printed", "agrees"),
    [
        ("a\n", "a\n", True),
        ("a\n", "b\n", False),
        ("a\n...\nc\n", "a\nb\nb\nc\n", True),
        ("a\n...\nc\n", "a\nb\n", False),
        ("at 14:03:22 on 2026-01-31\n", "at 09:00 on 2027-12-01\n", True),
        ("0.2507290012020655\n", "0.2507290012020656\n", True),
        ("0.2507290012020655\n", "0.2507290012120655\n", False),
        ("", "a\n", False),
    ],
)
def test_outputs_are_compared_but_for_times_and_lines_left_out(
    shown: str, printed: str, agrees: bool
) -> None:
    assert Example(typed="$ x", shown=shown, printed=printed).agrees is agrees


def test_a_command_that_fails_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="false ended with 1"):
        list(run_page("```console\n$ false\n```\n", tmp_path))


def test_files_are_written_added_to_and_changed(tmp_path: Path) -> None:
    page = (
        '```toml title="a.toml"\n[one]\nx = 1\ny = 2\n\n[two]\nx = 3\n```\n'
        '```toml title="changed in a.toml"\n[two]\nx = 4\n[one]\nz = 5\n'
        "[three]\nw = 6\nv = 7\n```\n"
        '```toml title="added to a.toml"\n[[four]]\n```\n'
    )
    assert list(run_page(page, tmp_path)) == []
    assert (tmp_path / "a.toml").read_text(encoding="utf-8") == (
        "[one]\nz = 5\nx = 1\ny = 2\n\n[two]\nx = 4\n\n[three]\nv = 7\nw = 6\n\n[[four]]\n"
    )


def test_programs_share_their_names_and_are_compared_with_the_block_below(tmp_path: Path) -> None:
    page = "```python\nx = 1\n```\n\n```python\nprint(x)\n```\n\n```text\n1\n```\n"
    first, second = run_page(page, tmp_path)
    assert (first.printed, second.shown, second.printed) == ("", "1\n", "1\n")
    assert shutil.which("sh"), "the commands of a page are run by a shell"
