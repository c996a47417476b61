"""Checks of this machine: packages, versions, ports, disk, screen, fonts and sound.

A finding is not ok if it prevents every session; what is missing affects only some.
"""

import ctypes.util
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from protocol.study.languages import built_in, built_in_codes
from runner.journal.database import SQLITE_VERSION, has_wal_reset_bug
from runner.screen_list import listed_screens
from runner.window.elements import first_font, missing_font

PACKAGES = ("protocol", "device", "runner", "analysis", "touchbeam")
DEPENDENCIES = ("psychopy", "pyserial", "numpy", "scipy", "matplotlib", "pydantic")
LEAST_DISK_BYTES = 200e6


@dataclass(frozen=True)
class Finding:
    """The result of one check."""

    what: str
    ok: bool
    value: str
    hint: str = ""
    missing: bool = False

    def line(self) -> str:
        mark = "FAIL" if not self.ok else "missing" if self.missing else "ok  "
        return f"{mark}  {self.what}: {self.value}" + (f" ({self.hint})" if self.hint else "")


def findings(touchbeam: Sequence[str] = ("touchbeam",)) -> list[Finding]:
    """Return the results of all checks, most important first; `touchbeam` is its own command."""
    from device.link.port import described_ports

    ports = [port["name"] for port in described_ports()]
    only = "only the simulated device and network addresses are available"
    fits = (3, 11) <= sys.version_info < (3, 13)
    # With their numbers, sizes, places and, where known, connectors.
    screens = [str(screen) for screen in listed_screens(touchbeam)]
    return [
        *_origins(),
        _required("python", platform.python_version(), "PsychoPy needs 3.11 or 3.12", ok=fits),
        *map(_dependency, DEPENDENCIES),
        _sqlite(),
        _disk(),
        _useful("serial ports", ", ".join(ports) or "none", only, there=bool(ports)),
        _useful(
            "screens", ", ".join(screens) or "none", "use --ratings console", there=bool(screens)
        ),
        _sound(),
        _fonts(),
    ]


def _required(what: str, value: str, hint: str, *, ok: bool) -> Finding:
    """Return the finding on what every session needs; `hint` says what to do where it is not."""
    return Finding(what, ok, value, "" if ok else hint)


def _useful(what: str, value: str, hint: str, *, there: bool) -> Finding:
    """Return the finding on what only some sessions need."""
    return Finding(what, ok=True, value=value, hint="" if there else hint, missing=not there)


def _origins() -> Iterator[Finding]:
    """Check that no other package hides one of ours, whose names are common words."""
    ours = Path(__file__).resolve().parent.parent
    for name in PACKAGES:
        # Not imported, because another package of this name would be executed.
        spec = find_spec(name)
        place = Path(spec.origin).resolve().parent if spec and spec.origin else None
        hint = f"expected {ours / name}; another package of this name hides it"
        yield _required(f"package {name}", str(place or "not found"), hint, ok=place == ours / name)


def _dependency(name: str) -> Finding:
    try:
        return Finding(name, ok=True, value=version(name))
    except PackageNotFoundError:
        return Finding(name, ok=False, value="missing", hint="run make demo once")


def _sqlite() -> Finding:
    hint = (
        "older than 3.51.3, which can lose transactions if a process commits during a checkpoint; "
        "touchbeam lets none commit then, and compares the file with its log before the log is "
        "reset"
    )
    shown = hint if has_wal_reset_bug(SQLITE_VERSION) else ""
    return Finding("SQLite", ok=True, value=SQLITE_VERSION, hint=shown)


def _disk() -> Finding:
    try:
        free = shutil.disk_usage(Path.cwd()).free
    except OSError as error:
        return _required("disk", f"unknown ({error})", "change to another folder", ok=False)
    hint = f"at least {LEAST_DISK_BYTES / 1e9:.1f} GB must be free; delete files"
    value = f"{free / 1e9:.1f} GB free in this folder"
    return _required("disk", value, hint, ok=free > LEAST_DISK_BYTES)


def _sound() -> Finding:
    """Check the libraries without which PsychoPy's keyboard falls back to a broken backend."""
    needed = ("asound", "jack") if sys.platform.startswith("linux") else ()
    missing = [name for name in needed if ctypes.util.find_library(name) is None]
    hint = "install them with apt if the participant's window does not start"
    value = ", ".join(missing) or "installed"
    return _useful("sound libraries", value, hint, there=not missing)


def _fonts() -> Finding:
    fc_list = shutil.which("fc-list")
    if fc_list is None:
        return _useful("fonts", "fontconfig", "names fonts", there=False)
    names = subprocess.run([fc_list], capture_output=True, text=True, check=False).stdout
    languages = {code: built_in(code) for code in built_in_codes()}
    installed = {
        code: first_font(each.fonts, names.__contains__) for code, each in languages.items()
    }
    hints = [
        missing_font(code, languages[code].fonts, languages[code].font_package)
        for code, font in installed.items()
        if font is None
    ]
    value = ", ".join(f"{code}: {font or 'none'}" for code, font in installed.items())
    return _useful("fonts", value, "; ".join(hints), there=not hints)
