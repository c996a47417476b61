"""The examples of a page, run as a reader would run them: `python -m handbook.examples PAGE...`.

In a page, fenced blocks mean this, in order, in one empty folder:

- `console`: lines that begin with `$ ` are commands, what follows each is what it prints. A line
  `...` stands for any lines.
- `toml` with `title="added to FILE"`: the lines are added at the end of FILE.
- `toml` with `title="changed in FILE"`: each key replaces the one of its table there, or joins it.
- any with `title="FILE"`: the file FILE.
- `python`: run after all of these, in one process; a `text` block right below is what it prints.

A line `--8<-- "docs/FILE"` stands for that file, as in the site.

Without options the outputs are compared with the page's. `--write` puts the real ones in the page.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

_FENCE = re.compile(
    r'^```(?P<language>\w+)(?: title="(?P<title>[^"]+)")?\n(?P<text>.*?)^```$', re.M | re.S
)
_INCLUDED = re.compile(r'^--8<-- "([^"]+)"\n', re.MULTILINE)
_SOURCE = Path(__file__).resolve().parents[1]
_CHANGES = (
    (r"\d{4}-\d\d-\d\d", "DATE"),
    (r"\b\d\d:\d\d(:\d\d)?\b", "TIME"),
    (r"[ \t]+$", ""),
    (r"(\.\d{12})\d+", r"\1"),  # the last digits depend on the processor
)
_DRIVER = """\
import json, sys
names = {}
for code in json.load(sys.stdin):
    exec(compile(code, "the page", "exec"), names)
    print("\\0", end="")
"""


@dataclass(frozen=True)
class Example:
    """What a reader types, what the page says that it prints, and what it did print."""

    typed: str
    shown: str
    printed: str

    @property
    def agrees(self) -> bool:
        """Whether the page is right, apart from dates, times, last digits and lines left out."""
        parts = re.split(r"^\.\.\.$", _normal(self.shown), flags=re.MULTILINE)
        pattern = ".*".join(re.escape(part.strip("\n")) for part in parts)
        return re.fullmatch(rf"\s*{pattern}\s*", _normal(self.printed), re.DOTALL) is not None


def _normal(text: str) -> str:
    for pattern, name in _CHANGES:
        text = re.sub(pattern, name, text, flags=re.MULTILINE)
    return text


def run_page(
    page: str, folder: Path, shell: Callable[[str, Path], str] | None = None
) -> Iterator[Example]:
    """Yield the examples of a page's text as they run in `folder`, an empty one.

    `shell` returns what a command prints in a folder; without it a real one does.

    Raises:
        ValueError: a command or a program failed; the message has its output.
    """
    page = _INCLUDED.sub(lambda line: (_SOURCE / line[1]).read_text(encoding="utf-8"), page)
    found = list(_FENCE.finditer(page))
    for block in found:
        language, title, text = block["language"], block["title"], block["text"]
        if language == "console":
            yield from _commands(text, folder, shell or in_shell)
        elif title and title.startswith("added to "):
            with (folder / title.removeprefix("added to ")).open("a", encoding="utf-8") as file:
                file.write(f"\n{text}")
        elif title and title.startswith("changed in "):
            _change(folder / title.removeprefix("changed in "), text)
        elif title:
            (folder / title).parent.mkdir(parents=True, exist_ok=True)
            (folder / title).write_text(text, encoding="utf-8")
    yield from _programs(page, [block for block in found if block["language"] == "python"], folder)


def _commands(block: str, folder: Path, shell: Callable[[str, Path], str]) -> Iterator[Example]:
    for example in re.split(r"^(?=\$ )", block, flags=re.MULTILINE):
        typed, _, shown = example.partition("\n")
        if typed:
            printed = shell(typed.removeprefix("$ "), folder)
            yield Example(typed=typed, shown=shown, printed=printed)


def in_shell(command: str, folder: Path) -> str:
    """Return what a command prints in `folder`."""
    return _output(["/bin/sh", "-c", command], folder)


def _programs(page: str, blocks: list[re.Match[str]], folder: Path) -> Iterator[Example]:
    if not blocks:
        return
    codes = [block["text"] for block in blocks]
    printed = _output([sys.executable, "-c", _DRIVER], folder, json.dumps(codes)).split("\0")
    for block, text in zip(blocks, printed, strict=False):
        below = _FENCE.match(page, block.end() + 2)
        shown = below["text"] if below and below["language"] == "text" else ""
        yield Example(typed=block["text"], shown=shown, printed=text)


def _output(command: list[str], folder: Path, given: str = "") -> str:
    places = [str(Path(sys.executable).parent), os.environ["PATH"]]
    own = {"PATH": os.pathsep.join(places), "MPLBACKEND": "agg", "LC_ALL": "C.UTF-8"}
    kept = {name: text for name, text in os.environ.items() if name not in {"DISPLAY", "COLUMNS"}}
    done = subprocess.run(
        command,
        cwd=folder,
        env=kept | own,
        input=given,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    printed = done.stdout.replace(str(folder), "/home/you")
    if done.returncode:
        raise ValueError(f"{command[-1]} ended with {done.returncode}:\n{printed}")
    return printed


def _change(file: Path, lines: str) -> None:
    """Give the keys of `lines`, under their table's header, these values in `file`."""
    tables = re.split(r"^(?=\[)", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
    for line in lines.splitlines():
        key, is_value, _ = line.partition(" = ")
        if line.startswith("["):
            header = line
        elif is_value:
            at = next((i for i, table in enumerate(tables) if table.startswith(header)), None)
            if at is None:
                tables[-1] += "\n"
                tables.append(f"{header}\n{line}\n")
            elif re.search(rf"^{key} = ", tables[at], re.MULTILINE):
                tables[at] = re.sub(
                    rf"^{key} = .*$", lambda _, line=line: line, tables[at], flags=re.MULTILINE
                )
            else:
                first, _, others = tables[at].partition("\n")
                tables[at] = f"{first}\n{line}\n{others}"
    file.write_text("".join(tables), encoding="utf-8")


def _written(page: str, examples: list[Example]) -> str:
    for example in examples:
        if example.agrees:
            continue
        lines = "".join(f"{line.rstrip()}\n" for line in example.printed.rstrip().splitlines())
        if example.typed.startswith("$ "):
            page = page.replace(f"{example.typed}\n{example.shown}", f"{example.typed}\n{lines}", 1)
        elif example.shown:
            page = page.replace(example.shown, lines, 1)
        else:
            typed = f"{example.typed}```\n"
            page = page.replace(typed, f"{typed}\n```text\n{lines}```\n", 1)
    return page


def main(arguments: list[str]) -> int:
    """Run the examples of the pages named; return the number of those that differ."""
    differ = 0
    for name in (name for name in arguments if name != "--write"):
        page = Path(name)
        text = page.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            examples = list(run_page(text, Path(folder)))
        if "--write" in arguments:
            page.write_text(_written(text, examples), encoding="utf-8")
        for example in examples:
            if not example.agrees:
                differ += 1
                print(f"{page}: {example.typed}\n{example.printed}")
    return differ


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
