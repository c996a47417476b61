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
import sys
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from tests.mutants import hook, survivors
from tests.mutants.forks import KEPT, OUTPUT, exit_code
from tests.mutants.mutation import ROOT, Mutant, mutants
from tests.mutants.selections import SELECTIONS

SEED = 2026
LEAST_S = 30.0
"""Tests that take longer than this, and than five times what they take without an error, hang."""
_FOUND, _SURVIVES = "found", "survives"


def passes(selection: Sequence[str], mutant: str = "", within_s: float = 600.0) -> bool:
    """Return whether the tests pass with `mutant`, or with none, in a process of their own."""
    return exit_code(lambda: _test(selection, mutant), within_s) == 0


def _test(selection: Sequence[str], mutant: str) -> int:
    import pytest

    class First:
        """Comes before the first conftest imports anything of ours.

        It also comes before pytest's own way to import modules, which takes what a plugin is
        part of.
        """

        @pytest.hookimpl(tryfirst=True)
        def pytest_load_initial_conftests(self) -> None:
            if mutant:
                hook.install(mutant)

    os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(KEPT / "hypothesis")
    os.environ.update(hook.environment(mutant) if mutant else {})
    loaded = "ignore:Module already imported"
    options = ["-x", "-q", "-p", "no:cacheprovider", "-W", loaded]
    return pytest.main([*options, *selection], plugins=[First()])


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


def found_by_tests(mutant: Mutant, results: Results) -> bool:
    """Return whether the tests find `mutant`; what is known of it already is in `results`."""
    how = results.of(mutant)
    if how is None:
        passed = passes(SELECTIONS[mutant.path], mutant.name, _limit_s(mutant.path))
        how = _SURVIVES if passed else _FOUND
        results.add(mutant, how)
        print("" if how == _FOUND else f"{mutant}\n    survives\n", end="", flush=True)
    return how == _FOUND


def run(path: str, sample: int | None) -> None:
    """Try every mutant of a module, or a sample, and write its survivors."""
    every = mutants(path)
    drawn = every
    if sample is not None and sample < len(every):
        drawn = random.Random(f"{SEED} {path}").sample(every, sample)
    results = Results(path)
    lives = [mutant.title for mutant in drawn if not found_by_tests(mutant, results)]
    survivors.record(path, lives, tried=len(drawn), of=len(every))
    print(f"{path}: {len(drawn) - len(lives)} of {len(drawn)} found", flush=True)


@cache
def _limit_s(path: str) -> float:
    """Return how long the tests of a module may take; they must pass without any change."""
    began_s = time.monotonic()
    if not passes(SELECTIONS[path]):
        sys.exit(f"{path}: its tests fail without any change; see {OUTPUT}")
    return max(LEAST_S, 5 * (time.monotonic() - began_s))


def main() -> None:
    """Try the mutants of the modules that are asked for, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="*", metavar="MODULE", help="such as device/rig.py")
    parser.add_argument("--sample", type=int, help="try as many of each module, drawn by a seed")
    options = parser.parse_args()
    for path in options.paths or SELECTIONS:
        run(path, options.sample)
    if unexplained := survivors.unexplained():
        sys.exit(f"{unexplained} survivors are not explained; see {survivors.PAGE}")


if __name__ == "__main__":
    main()
