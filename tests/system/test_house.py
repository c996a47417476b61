"""The house itself: rooms of a size that can be read, and doors that lead where they say."""

import doctest
import re
from collections import Counter
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("protocol", "device", "runner", "analysis")
MODULES = sorted(
    path
    for package in PACKAGES
    for path in (ROOT / package).rglob("*.py")
    if path.stem != "__init__"
)
ROOMS = sorted({path.parent for path in MODULES})
MOST_MODULES = 12
FEWEST_LINES = 25


def named(room: Path) -> str:
    return ".".join(room.relative_to(ROOT).parts)


@pytest.mark.parametrize("room", ROOMS, ids=named)
def test_the_public_face_of_a_room_exists(room: Path) -> None:
    """Each `module.Name` in a room's docstring can be imported from there."""
    text = import_module(named(room)).__doc__ or ""
    _, _, face = text.partition("Public face:")
    for module, name in re.findall(r"`(\w+)\.(\w+)`", face):
        assert hasattr(import_module(f"{named(room)}.{module}"), name), f"{room}: {module}.{name}"


@pytest.mark.parametrize("path", [path for path in MODULES if ">>>" in path.read_text()], ids=named)
def test_the_examples_of_a_module_are_right(path: Path) -> None:
    assert doctest.testmod(import_module(named(path.with_suffix("")))).failed == 0


@pytest.mark.parametrize("room", ROOMS, ids=named)
def test_a_room_has_at_most_twelve_modules(room: Path) -> None:
    assert len([path for path in MODULES if path.parent == room]) <= MOST_MODULES


def test_no_module_is_a_splinter() -> None:
    short = [path for path in MODULES if len(path.read_text().splitlines()) < FEWEST_LINES]
    assert not short


@pytest.mark.parametrize("package", PACKAGES)
def test_no_file_name_is_used_twice_in_a_package(package: str) -> None:
    names = Counter(path.stem for path in MODULES if path.is_relative_to(ROOT / package))
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("room", ROOMS, ids=named)
def test_a_room_imports_nothing(room: Path) -> None:
    """Its `__init__` is a docstring, so that a name has one address and imports stay lazy."""
    lines = (room / "__init__.py").read_text().splitlines()
    assert not [line for line in lines if line.startswith(("import ", "from "))]


def test_the_map_names_only_what_there_is() -> None:
    """Every folder and file that docs/architecture.md names exists."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:protocol|device|runner|analysis|tests)/[\w/.]+)`", page))
    assert {place for place in named if not (ROOT / place).exists()} == set()
    rooms = {"/".join(room.relative_to(ROOT).parts) for room in ROOMS} - set(PACKAGES)
    unnamed = {room for room in rooms if not any(room.startswith(place) for place in named)}
    assert not unnamed, f"rooms that the map lacks: {unnamed}"


def rows_of_the_map() -> list[str]:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    _, _, below = page.partition("## Where new code goes")
    return [line for line in below.splitlines() if line.startswith("| ") and "`" in line]


@pytest.mark.parametrize("row", rows_of_the_map(), ids=lambda row: row.split("|")[1].strip())
def test_a_row_of_the_map_leads_to_what_it_names(row: str) -> None:
    """A file is at its path, or in the folder named before it; a name stands in the file before."""
    place = folder = ROOT
    for named in re.findall(r"`([^` ]+)`", row):
        found = next((at for at in (ROOT / named, folder / named) if at.exists()), None)
        if found is not None:
            place, folder = found, found if found.is_dir() else found.parent
            continue
        assert re.fullmatch(r"\w+", named), f"no such file: {named}"
        texts = [place] if place.is_file() else sorted(place.glob("*.py"))
        assert any(re.search(rf"\b{named}\b", at.read_text()) for at in texts), f"{named}: {place}"
