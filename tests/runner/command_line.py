"""The command line as tests type it, in their own process or another one."""

import re
import sys
from pathlib import Path

from touchbeam.cli.app import main

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))


def typed(*arguments: str | Path) -> int:
    """Run a command in this process; return its exit code."""
    before = sys.argv
    sys.argv = ["touchbeam", *map(str, arguments)]
    try:
        main()
    except SystemExit as stop:
        return int(stop.code or 0)
    finally:
        sys.argv = before
    raise AssertionError("main always exits")


def everything(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def assert_matches(pattern: str, text: str) -> None:
    assert re.search(pattern, text), text
