"""Orders of a registered study are reproduced by the script of docs/registration.md alone."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.runner.registered_study import registered_in, run_session

PAGE = Path(__file__).parents[2] / "docs" / "registration.md"


def checked(folder: Path, tmp_path: Path) -> list[str]:
    (script,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    file = tmp_path / "orders.py"
    file.write_text(script, encoding="utf-8")
    command = [sys.executable, "-I", str(file), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    return done.stdout.splitlines()


@pytest.mark.parametrize("name", ["paper", "extended"])
def test_the_script_of_the_page_reproduces_the_orders(tmp_path: Path, name: str) -> None:
    folder = registered_in(tmp_path / "study", name)
    run_session(folder, "P01")
    run_session(folder, "P02")
    run_session(folder, "P03", kind="rehearsal")
    assert checked(folder, tmp_path) == ["ok   P01/1", "ok   P02/1", "ok   P03/1 (rehearsal)"]
