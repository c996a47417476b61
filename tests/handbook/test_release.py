"""What a release consists of: its two distributions, its changes, and how to cite it."""

import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
from hatchling.metadata.core import ProjectMetadata

import touchbeam
from handbook import wheel
from handbook.build import ROOT

NEEDED = {
    "README.md",
    "LICENSE",
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "Makefile",
    "zensical.toml",
    "pyproject.toml",
    "docs/index.md",
    "docs/pictures/rig.svg",
    "handbook/build.py",
    "handbook/wheel.py",
    "protocol/languages/en.toml",
    "tests/data/published_scores.csv",
}


def test_make_tells_what_it_installs_in_words(tmp_path: Path) -> None:
    """On a bare Debian, whose Python has no venv until a package brings it."""
    python, apt = tmp_path / "python3", tmp_path / "apt-get"
    python.write_text(
        "#!/bin/sh\n[ -e installed ] || { echo 'ensurepip is not available'; exit 1; }\n"
        "mkdir -p .uv/bin && echo '#!/bin/sh' >.uv/bin/pip && chmod +x .uv/bin/pip\n"
    )
    apt.write_text("#!/bin/sh\ntouch installed\n")
    for program in (python, apt):
        program.chmod(0o755)
    make = ["make", "-f", str(ROOT / "Makefile"), ".uv/bin/uv", f"PYTHON={python}"]
    path = f"{tmp_path}:{os.environ['PATH']}"
    done = subprocess.run(
        make,
        cwd=tmp_path,
        # Without what a make tells those that it starts, as this test may be one of them.
        env={**os.environ, "PATH": path, "MAKEFLAGS": "", "MAKELEVEL": ""},
        check=False,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "Installing uv, which installs the packages, into .uv ...",
        "Installing python3-venv ...",
    ]


def built(kind: str, folder: Path) -> Path:
    """Return the distribution of this kind, built into the folder."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (distribution,) = folder.iterdir()
    return distribution


def test_the_wheel_has_every_file_of_the_packages_and_the_documentation(tmp_path: Path) -> None:
    packages = ("protocol", "device", "runner", "analysis", "touchbeam")
    found = {path for package in packages for path in (ROOT / package).rglob("*") if path.is_file()}
    files = {path.relative_to(ROOT).as_posix() for path in found if path.suffix != ".pyc"}
    with zipfile.ZipFile(built("wheel", tmp_path)) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    site = {name for name in names if name.startswith("touchbeam/documentation/")}
    assert names - site == files
    assert "analysis/report/report.html" in names  # data are packed, too
    pages = {path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")}
    assert site >= {f"touchbeam/documentation/{page.with_suffix('.html')}" for page in pages}
    assert {"touchbeam/documentation/search.js", "touchbeam/documentation/pictures/rig.svg"} <= site


def test_an_editable_installation_neither_needs_nor_builds_the_site(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    assert any("zensical" in name for name in wheel.get_requires_for_build_wheel())
    assert not any("zensical" in name for name in wheel.get_requires_for_build_editable())
    project: ProjectMetadata[Any] = ProjectMetadata(str(ROOT), None)
    hook = wheel.Documentation(str(ROOT), {}, None, project, str(tmp_path), "wheel")
    data: dict[str, dict[str, str]] = {"force_include": {}}
    hook.initialize("editable", data)
    assert data == {"force_include": {}}


def test_the_source_distribution_has_what_a_laboratory_needs(tmp_path: Path) -> None:
    with tarfile.open(built("sdist", tmp_path)) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    assert names >= NEEDED
    assert [name for name in names if name.startswith(("site/", ".venv", "demo"))] == []


def test_the_citation_is_of_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    found = re.search(r"^version: (.+)$", text, re.MULTILINE)
    assert found
    assert found[1] == touchbeam.__version__


def test_the_address_is_the_one_that_the_project_names() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    named = re.search(r'^repository-code: "?([^"\n]+)', citation, re.MULTILINE)
    assert (named and named[1]) == project["urls"].get("Source")
    assert project["urls"].get("Source", "in this folder") in readme


def test_the_readme_names_the_models_of_all_generators_that_are_simulated() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    modules = [path.read_text(encoding="utf-8") for path in (ROOT / "device").rglob("*.py")]
    models = {name for text in modules for name in re.findall(r'idn="[^",]+,(\w+),SIM', text)}
    assert len(models) > 3
    assert {name for name in models if name not in readme} == set()


def test_the_changes_have_an_entry_for_this_version() -> None:
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    # A version that is not released yet has its rows under Next.
    heading = "Next" if ".dev" in touchbeam.__version__ else touchbeam.__version__
    assert f"\n## {heading}\n" in changes
