"""Checks of this machine: packages, versions, ports, disk, screen, fonts and sound.

A finding is not ok if it prevents every session; what is missing affects only some.
"""

import ctypes.util
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from protocol.study.languages import built_in, built_in_codes
from runner.displays.screen_list import listed_screens
from runner.journal.database import SQLITE_VERSION, has_wal_reset_bug
from runner.window.elements import first_font, missing_font

PACKAGES = ("protocol", "device", "runner", "analysis", "touchbeam")
DEPENDENCIES = ("psychopy", "pyserial", "numpy", "scipy", "matplotlib", "pydantic")
LEAST_DISK_BYTES = 200e6


@dataclass(frozen=True, kw_only=True)
class Finding:
    """The result of one check."""

    what: str
    ok: bool
    value: str
    hint: str = ""
    missing: bool = False

    def line(self) -> str:
        """Return one line for people to read."""
        mark = "FAIL" if not self.ok else "missing" if self.missing else "ok  "
        return f"{mark}  {self.what}: {self.value}" + (f" ({self.hint})" if self.hint else "")

    def record(self) -> dict[str, object]:
        """Return the same for programs."""
        return asdict(self)


def findings(touchbeam: Sequence[str] = ("touchbeam",)) -> list[Finding]:
    """Return the results of all checks, most important first; `touchbeam` is its own command."""
    return [
        *_origins(),
        _python(),
        *(_dependency(name) for name in DEPENDENCIES),
        _sqlite(),
        _disk(),
        _ports(),
        _screens(touchbeam),
        _sound(),
        _fonts(),
    ]


def _origins() -> Iterator[Finding]:
    """Check that no other package hides one of ours, whose names are common words."""
    ours = Path(__file__).resolve().parent.parent
    for name in PACKAGES:
        # Not imported, because another package of this name would be executed.
        spec = find_spec(name)
        place = Path(spec.origin).resolve().parent if spec and spec.origin else None
        ok = place == ours / name
        yield Finding(
            what=f"package {name}",
            ok=ok,
            value=str(place or "not found"),
            hint="" if ok else f"expected {ours / name}; another package of this name hides it",
        )


def _python() -> Finding:
    ok = (3, 11) <= sys.version_info < (3, 13)
    return Finding(
        what="python",
        ok=ok,
        value=platform.python_version(),
        hint="" if ok else "PsychoPy needs 3.11 or 3.12",
    )


def _dependency(name: str) -> Finding:
    try:
        return Finding(what=name, ok=True, value=version(name))
    except PackageNotFoundError:
        return Finding(what=name, ok=False, value="missing", hint="run make demo once")


def _sqlite() -> Finding:
    hint = (
        "older than 3.51.3, which can lose transactions if a process commits during a checkpoint; "
        "touchbeam lets none commit then, and compares the file with its log before the log is "
        "reset"
    )
    return Finding(
        what="SQLite",
        ok=True,
        value=SQLITE_VERSION,
        hint=hint if has_wal_reset_bug(SQLITE_VERSION) else "",
    )


def _disk() -> Finding:
    try:
        free = shutil.disk_usage(Path.cwd()).free
    except OSError as error:
        return Finding(
            what="disk", ok=False, value=f"unknown ({error})", hint="change to another folder"
        )
    ok = free > LEAST_DISK_BYTES
    return Finding(
        what="disk",
        ok=ok,
        value=f"{free / 1e9:.1f} GB free in this folder",
        hint="" if ok else f"at least {LEAST_DISK_BYTES / 1e9:.1f} GB must be free; delete files",
    )


def _ports() -> Finding:
    from device.link.port import described_ports

    names = [port["name"] for port in described_ports()]
    return Finding(
        what="serial ports",
        ok=True,
        value=", ".join(names) or "none",
        missing=not names,
        hint="" if names else "only the simulated device and network addresses are available",
    )


def _screens(touchbeam: Sequence[str]) -> Finding:
    """List the screens with their numbers, sizes, places and, where known, connectors."""
    there = listed_screens(touchbeam)
    return Finding(
        what="screens",
        ok=True,
        value=", ".join(map(str, there)) or "none",
        missing=not there,
        hint="" if there else "use --ratings console",
    )


def _sound() -> Finding:
    """Check the libraries without which PsychoPy's keyboard falls back to a broken backend."""
    needed = ("asound", "jack") if sys.platform.startswith("linux") else ()
    missing = [name for name in needed if ctypes.util.find_library(name) is None]
    return Finding(
        what="sound libraries",
        ok=True,
        value=", ".join(missing) or "installed",
        hint="install them with apt if the participant's window does not start" if missing else "",
        missing=bool(missing),
    )


def _fonts() -> Finding:
    fc_list = shutil.which("fc-list")
    if fc_list is None:
        return Finding(what="fonts", ok=True, value="fontconfig", hint="names fonts", missing=True)
    names = subprocess.run([fc_list], capture_output=True, text=True, check=False).stdout
    languages = {code: built_in(code) for code in built_in_codes()}
    installed = {
        code: first_font(each.fonts, names.__contains__) for code, each in languages.items()
    }
    lacking = [code for code, font in installed.items() if font is None]
    return Finding(
        what="fonts",
        ok=True,
        value=", ".join(f"{code}: {font or 'none'}" for code, font in installed.items()),
        missing=bool(lacking),
        hint="; ".join(
            missing_font(code, languages[code].fonts, languages[code].font_package)
            for code in lacking
        ),
    )
