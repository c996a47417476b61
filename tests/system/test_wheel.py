"""The package as it is installed elsewhere: complete, and at work outside the tree."""

import json
import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
import typer

ROOT = Path(__file__).parents[2]


def test_the_wheel_works_outside_the_tree(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    assert (tmp_path / "site" / "touchbeam" / "py.typed").is_file()
    program = (
        "import sys; sys.path.insert(0, 'site'); import touchbeam.cli\n"
        "print(touchbeam.cli.__file__)\n"
        "sys.argv = ['touchbeam', 'import', sys.argv[1], 'study']\n"
        "try: touchbeam.cli.main()\n"
        "except SystemExit as stop: assert not stop.code\n"
        "import touchbeam; assert len(touchbeam.load('study').scores) == 9\n"
        "sys.argv = ['touchbeam', 'report', 'study']; touchbeam.cli.main()"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program, str(ROOT / "tests" / "data" / "published_scores.csv")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.startswith(str(tmp_path / "site"))
    assert "8.31" in shown.stdout
    assert (tmp_path / "study" / "report" / "report.html").is_file()


def test_an_installed_wheel_opens_its_documentation(tmp_path: Path) -> None:
    """In an environment with nothing but what touchbeam needs, far from its source."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    venv.create(tmp_path / "env", with_pip=False)
    (packages,) = (tmp_path / "env" / "lib").glob("python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    # The installed packages of the tests stand in for a package index; touchbeam is not among them.
    (packages / "needed.pth").write_text(f"{Path(typer.__file__).parents[1]}\n")
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > "{tmp_path}/opened"\n')
    browser.chmod(0o755)
    (tmp_path / "home").mkdir()
    python = tmp_path / "env" / "bin" / "python"
    for words, title in (((), "touchbeam"), (("Study", "file"), "Study file")):
        docs = subprocess.run(
            [python, "-c", "import touchbeam.cli; touchbeam.cli.main()", "docs", *words],
            cwd=tmp_path / "home",
            env={"HOME": str(tmp_path / "home"), "BROWSER": str(browser)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (docs.returncode, docs.stderr) == (0, "")
        page = Path(docs.stdout.strip())
        assert page.is_relative_to(packages)
        assert f"<title>{title} - touchbeam</title>" in page.read_text(encoding="utf-8")
        assert (tmp_path / "opened").read_text() == f"{page.as_uri()}\n"
    assert [*(tmp_path / "home").iterdir()] == []


@pytest.mark.soak
def test_the_notebook_tutorial_starts_a_kernel_in_a_new_copy_of_the_source(tmp_path: Path) -> None:
    """It needs the network: the environment comes from the package index."""
    uv = shutil.which("uv") or str(ROOT / ".uv" / "bin" / "uv")
    copy = tmp_path / "touchbeam"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".*", "tests", "site", "dist"))
    tutorial = (ROOT / "docs" / "tutorials" / "notebook.md").read_text(encoding="utf-8")
    install, start = re.findall(r"```sh\n(.*?)\n```", tutorial)
    environ = {name: text for name, text in os.environ.items() if name != "VIRTUAL_ENV"}
    environ["PATH"] = os.pathsep.join(
        [str(copy / ".venv" / "bin"), str(Path(uv).parent), os.environ["PATH"]]
    )
    for command in ("uv sync --frozen --no-dev", install):
        subprocess.run(command, shell=True, cwd=copy, env=environ, check=True)
    server = subprocess.Popen(
        f"exec {start} --no-browser --allow-root --port=0",
        shell=True,
        cwd=tmp_path,
        env=environ,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert server.stderr
        assert any("is running at" in line for line in server.stderr)
    finally:
        server.terminate()
        server.communicate()
    notebook = {
        "cells": [
            {
                "cell_type": "code",
                "metadata": {},
                "source": text,
                "outputs": [],
                "execution_count": None,
            }
            for text in re.findall(r"```python\n(.*?)```", tutorial, re.DOTALL)
        ],
        "metadata": {},
        "nbformat": 4,
        "nbformat_minor": 4,
    }
    (tmp_path / "figure.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    for command in (
        "touchbeam demo --participants 5 --out mystudy",
        "jupyter execute figure.ipynb",
    ):
        subprocess.run(command, shell=True, cwd=tmp_path, env=environ, check=True)
    assert (tmp_path / "contrast.svg").is_file()
