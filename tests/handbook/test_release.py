"""What a release consists of: the source distribution, and how to cite it."""

import re
import subprocess
import sys
import tarfile
from pathlib import Path

import touchbeam
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
    "protocol/languages/en.toml",
    "tests/data/published_scores.csv",
}


def test_the_source_distribution_has_what_a_laboratory_needs(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    assert names >= NEEDED
    assert [name for name in names if name.startswith(("site/", ".venv", "demo"))] == []


def test_the_citation_is_of_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    found = re.search(r"^version: (.+)$", text, re.MULTILINE)
    assert found
    assert found[1] == touchbeam.__version__
