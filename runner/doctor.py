"""What a session needs of this machine: packages, versions, ports, disk, screen, fonts, sound.

A finding that stops every session is not ok; one that only some sessions need is a remark.
"""

import ctypes.util
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from protocol.study.languages import built_in, built_in_codes
from runner.window.text_layout import first_font, missing_font

PACKAGES = ("protocol", "device", "runner", "analysis")
DEPENDENCIES = ("psychopy", "pyserial", "numpy", "scipy", "matplotlib", "pydantic")
LEAST_DISK_BYTES = 200e6


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing looked at."""

    what: str
    ok: bool
    value: str
    hint: str = ""

    def line(self) -> str:
        """One line for a person."""
        mark = "ok  " if self.ok else "FAIL"
        return f"{mark}  {self.what}: {self.value}" + (f" ({self.hint})" if self.hint else "")

    def record(self) -> dict[str, object]:
        """The same for a program."""
        return asdict(self)


def findings() -> list[Finding]:
    """Return everything looked at, in the order in which it matters."""
    return [
        *_origins(),
        _python(),
        *(_dependency(name) for name in DEPENDENCIES),
        _disk(),
        _ports(),
        _screen(),
        _sound(),
        _fonts(),
    ]


def _origins() -> Iterator[Finding]:
    """Our packages have plain names; another one of that name must not have taken their place."""
    ours = Path(__file__).resolve().parent.parent
    for name in PACKAGES:
        spec = find_spec(name)
        place = Path(spec.origin).resolve().parent if spec and spec.origin else None
        ok = place == ours / name
        yield Finding(
            what=f"package {name}",
            ok=ok,
            value=str(place or "not found"),
            hint=""
            if ok
            else f"expected {ours / name}; another package of this name is in the way",
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


def _disk() -> Finding:
    try:
        free = shutil.disk_usage(Path.cwd()).free
    except OSError as error:
        return Finding(
            what="disk", ok=False, value=f"unknown ({error})", hint="go to another folder"
        )
    ok = free > LEAST_DISK_BYTES
    return Finding(
        what="disk",
        ok=ok,
        value=f"{free / 1e9:.1f} GB free here",
        hint="" if ok else "free some space",
    )


def _ports() -> Finding:
    from device.link.port import described_ports

    names = [port["name"] for port in described_ports()]
    return Finding(
        what="serial ports",
        ok=True,
        value=", ".join(names) or "none",
        hint="" if names else "only the simulated device and network addresses can be used",
    )


def _screen() -> Finding:
    needs_display = sys.platform.startswith("linux")
    display = os.environ.get("DISPLAY", "")
    there = bool(display) or not needs_display
    return Finding(
        what="screen",
        ok=True,
        value=display or ("there" if there else "none"),
        hint="" if there else "use --ratings console here",
    )


def _sound() -> Finding:
    """PsychoPy's keyboard falls back to a broken backend where these libraries are missing."""
    needed = ("asound", "jack") if sys.platform.startswith("linux") else ()
    missing = [name for name in needed if ctypes.util.find_library(name) is None]
    return Finding(
        what="sound libraries",
        ok=True,
        value=f"missing: {', '.join(missing)}" if missing else "there",
        hint="the participant's window needs libasound2 and libjack" if missing else "",
    )


def _fonts() -> Finding:
    fc_list = shutil.which("fc-list")
    if fc_list is None:
        return Finding(what="fonts", ok=True, value="unknown", hint="fontconfig is not installed")
    names = subprocess.run([fc_list], capture_output=True, text=True, check=False).stdout
    languages = {code: built_in(code) for code in built_in_codes()}
    found = {code: first_font(each.fonts, names.__contains__) for code, each in languages.items()}
    lacking = [code for code, font in found.items() if font is None]
    return Finding(
        what="fonts",
        ok=True,
        value=", ".join(f"{code}: {font or 'none'}" for code, font in found.items()),
        hint="; ".join(
            missing_font(code, languages[code].fonts, languages[code].font_package)
            for code in lacking
        ),
    )
