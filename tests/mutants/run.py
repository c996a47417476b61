"""Do the tests find small errors in the modules that guard finger and data?

`python -m tests.mutants.run` makes one change after the other and runs the tests that
`tests/mutants/selections.py` has for the module. It goes on where it was stopped, and writes what
no test finds to `tests/mutants/survivors.md`, which keeps the reasons that were written there.
"""

import argparse
import hashlib
import json
import os
import random
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

# What takes long to load and has nothing of ours: each mutant's process starts with it.
import hypothesis  # noqa: F401
import numpy as np  # noqa: F401
import pydantic  # noqa: F401
import pytest
import scipy.optimize
import scipy.stats  # noqa: F401

from tests.mutants import hook, survivors
from tests.mutants.mutation import ROOT, Mutant, mutants
from tests.mutants.selections import SELECTIONS

KEPT = ROOT / ".mutants"
SEED = 2026
LEAST_S = 30.0
"""Tests that take longer than this, and than five times what they take without an error, hang."""
_FOUND, _SURVIVES = "found", "survives"


def passes(selection: Sequence[str], mutant: str = "", within_s: float = 600.0) -> bool:
    """Return whether the tests pass with `mutant`, or with none, in a process of their own."""
    if (process := os.fork()) == 0:
        _test(selection, mutant)
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        done, status = os.waitpid(process, os.WNOHANG)
        if done:
            break
        time.sleep(0.01)
    _end(process)
    if not done:
        _, status = os.waitpid(process, 0)
    return status == 0


def _test(selection: Sequence[str], mutant: str) -> None:
    os.setsid()
    with (KEPT / "output.txt").open("w") as output:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
    os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(KEPT / "hypothesis")
    os.environ.update(hook.environment(mutant) if mutant else {})
    if mutant:
        hook.install(mutant)
    loaded = "ignore:Module already imported"
    os._exit(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-W", loaded, *selection]))


def _end(process: int) -> None:
    """End what the tests may have left behind: everything in their process group."""
    try:
        os.killpg(process, signal.SIGKILL)
    except ProcessLookupError:
        return


class Results:
    """What was found so far; a result is kept as long as what it rests on stays as it was."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._file = KEPT / f"{path.replace('/', '.')}.json"
        self._digests = {
            "module": _digest([ROOT / path, ROOT / "tests/mutants/mutation.py"]),
            "tests": _digest(_files(SELECTIONS[path])),
        }
        kept = json.loads(self._file.read_text()) if self._file.exists() else {}
        is_same = kept.get("module") == self._digests["module"]
        found: dict[str, str] = kept.get("results", {}) if is_same else {}
        if kept.get("tests") != self._digests["tests"]:  # tests become sharper, not duller
            found = {title: how for title, how in found.items() if how == _FOUND}
        self._found = found

    def of(self, mutant: Mutant) -> str | None:
        """Return how `mutant` fared, None if that is not known."""
        return self._found.get(mutant.title)

    def add(self, mutant: Mutant, how: str) -> None:
        """Keep how `mutant` fared."""
        self._found[mutant.title] = how
        text = json.dumps({**self._digests, "results": self._found}, indent=1)
        self._file.write_text(text, encoding="utf-8")


def _files(selection: Sequence[str]) -> list[Path]:
    found: set[Path] = set()
    for place in selection:
        found |= {ROOT / place} if place.endswith(".py") else set((ROOT / place).rglob("*.py"))
    return sorted(found)


def _digest(files: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def run(path: str, sample: int | None) -> None:
    """Try every mutant of a module, or a sample, and write its survivors."""
    every = mutants(path)
    drawn = every
    if sample is not None and sample < len(every):
        drawn = random.Random(f"{SEED} {path}").sample(every, sample)
    results = Results(path)
    left = [mutant for mutant in drawn if results.of(mutant) is None]
    limit_s = _limit_s(path) if left else 0.0
    for mutant in left:
        passed = passes(SELECTIONS[path], mutant.name, limit_s)
        results.add(mutant, _SURVIVES if passed else _FOUND)
        if passed:
            print(f"{mutant}\n    survives", flush=True)
    lives = [mutant.title for mutant in drawn if results.of(mutant) == _SURVIVES]
    survivors.record(path, lives, tried=len(drawn), of=len(every))
    print(f"{path}: {len(drawn) - len(lives)} of {len(drawn)} found", flush=True)


def _limit_s(path: str) -> float:
    began_s = time.monotonic()
    if not passes(SELECTIONS[path]):
        sys.exit(f"{path}: its tests fail without any change; see {KEPT / 'output.txt'}")
    return max(LEAST_S, 5 * (time.monotonic() - began_s))


def main() -> None:
    """Try the mutants of the modules that are asked for, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="*", metavar="MODULE", help="such as device/rig.py")
    parser.add_argument("--sample", type=int, help="try as many of each module, drawn by a seed")
    options = parser.parse_args()
    KEPT.mkdir(exist_ok=True)
    for path in options.paths or SELECTIONS:
        run(path, options.sample)
    if unexplained := survivors.unexplained():
        sys.exit(f"{unexplained} survivors are not explained; see {survivors.PAGE}")


if __name__ == "__main__":
    main()
