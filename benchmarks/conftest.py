"""The table at the end of `make bench`."""

import platform
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from benchmarks.compared import page


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--page", metavar="FILE", help="write the table of comparisons to this file")


def machine() -> str:
    """Return what the figures were measured on, in words."""
    cores = psutil.cpu_count(logical=True)
    memory_gb = psutil.virtual_memory().total / 1e9
    return (
        f"{_processor()}, {cores} cores, {memory_gb:.0f} GB, {platform.system()} "
        f"{platform.release()}, Python {platform.python_version()}, numpy {np.__version__}"
    )


def _processor() -> str:
    lines = Path("/proc/cpuinfo")
    if lines.is_file():
        for line in lines.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    session = getattr(config, "_benchmarksession", None)
    if session is None or not session.benchmarks:
        return
    text = page(session.benchmarks, machine())
    terminalreporter.write_line(text.partition("## Beside")[2].partition("\n")[2])
    if name := config.getoption("--page"):
        Path(name).write_text(text, encoding="utf-8")
