"""Mutants: how many small errors in the code that guards data and finger do simulated days find?

`python -m tests.system.day.mutants` draws mutants by a fixed seed, runs days with each until one
breaks an invariant, and lists the mutants that survive. `--ordinary` then runs the ordinary tests
with each survivor: what they find, the days should find.
"""

import argparse
import ast
import copy
import importlib.abc
import importlib.machinery
import importlib.util
import os
import random
import signal
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[3]
SOURCES = (
    "runner/session/loop.py",
    "runner/session/trial.py",
    "protocol/journal/transitions.py",
    "device/drivers/driver.py",
    "device/drivers/board.py",
    "device/drivers/limits.py",
    "runner/journal/store.py",
)
ORDINARY = (
    "tests/device", "tests/runner/session", "tests/runner/journal", "tests/protocol/journal",
    "tests/system/test_killed.py", "tests/system/test_session_faults.py",
    "tests/system/test_lying_devices.py", "tests/system/test_device_safety.py",
)  # fmt: skip
SEED = 2026
A_DAY_S = 60
"""A day that takes longer does not end."""
_MUTANT = "TOUCHBEAM_MUTANT"
_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_STATES = {
    "new", "idle", "armed", "paused", "trial", "touching", "completed", "excluded",
    "dropped",
}  # fmt: skip
_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """A change of the `place`-th node of a file that can be changed."""

    path: str
    place: int
    line: int
    what: str

    @property
    def name(self) -> str:
        """How it is told from others."""
        return f"{self.path}:{self.place}"

    def __str__(self) -> str:
        return f"{self.path}:{self.line} {self.what}"


def mutated(tree: ast.Module, place: int) -> tuple[ast.Module, int, str]:
    """Return a copy of `tree` with one change, its line, and what was changed.

    Raises:
        IndexError: it has no such place.
    """
    changed = copy.deepcopy(tree)
    node = _changeable(changed)[place]
    before = ast.unparse(node)
    _change(node)
    return ast.fix_missing_locations(changed), node.lineno, f"{before} -> {ast.unparse(node)}"


Changeable = ast.Compare | ast.BinOp | ast.BoolOp | ast.UnaryOp | ast.If | ast.Constant | ast.Expr


def _changeable(tree: ast.AST) -> list[Changeable]:
    """Return the nodes that are worth a change: not annotations, messages and names."""
    left_out: set[int] = set()
    states: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr | ast.Raise):
            left_out |= _inside(node)
        for annotation in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            left_out |= _inside(annotation)
        if isinstance(node, ast.Dict):
            states |= {number for value in node.values for number in _inside(value)}
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, Changeable) and id(node) not in left_out
        if _is_changeable(node) or (id(node) in states and _is_state(node))
    ]


def _inside(node: ast.AST | None) -> set[int]:
    return set() if node is None else {id(inner) for inner in ast.walk(node)}


def _is_state(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value in _STATES


def _is_changeable(node: ast.AST) -> bool:
    match node:
        case ast.Compare(ops=[one]):
            return type(one) in _COMPARISONS
        case ast.BinOp(op=operator):
            return type(operator) in _OPERATORS
        case ast.Constant(value=value):
            return isinstance(value, bool | int | float)
        case ast.Expr(value=ast.Call()):
            return True
    return isinstance(node, ast.BoolOp | ast.If) or (
        isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    )


def _change(node: Changeable) -> None:
    match node:
        case ast.Compare():
            node.ops = [_COMPARISONS[type(node.ops[0])]()]
        case ast.BinOp():
            node.op = _OPERATORS[type(node.op)]()
        case ast.BoolOp():
            node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        case ast.UnaryOp():
            node.op = ast.UAdd()
            node.operand = ast.Call(ast.Name("bool", ast.Load()), [node.operand], [])
        case ast.If():
            node.test = ast.UnaryOp(ast.Not(), node.test)
        case ast.Constant():
            node.value = _other(node.value)
        case ast.Expr():
            node.value = ast.Constant(None)


def _other(value: object) -> bool | int | float | str:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value * 2 + 1
    return "armed" if value == "idle" else "idle"


def mutants() -> list[Mutant]:
    """Return every mutant of `SOURCES`."""
    found = []
    for path in SOURCES:
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        for place in range(len(_changeable(tree))):
            _, line, what = mutated(tree, place)
            found.append(
                Mutant(path=path, place=place, line=line, what=" ".join(what.split())[:90])
            )
    return found


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module with a change in it."""

    def __init__(self, name: str) -> None:
        path, _, place = name.partition(":")
        self._path, self._place = ROOT / path, int(place)
        self._module = path.removesuffix(".py").replace("/", ".")

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self._module:
            return None
        return importlib.util.spec_from_file_location(fullname, self._path, loader=self)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> None:
        return None

    def exec_module(self, module: ModuleType) -> None:
        tree, _, _ = mutated(ast.parse(self._path.read_text(encoding="utf-8")), self._place)
        exec(compile(tree, str(self._path), "exec"), vars(module))


def pytest_configure() -> None:
    """Let pytest, with `-p tests.system.day.mutants`, test the mutant in the environment."""
    if _MUTANT in os.environ:
        sys.meta_path.insert(0, _Finder(os.environ[_MUTANT]))


def _days(name: str, seeds: int) -> None:
    """Run days with a mutant until one fails; exit with 1 if one does."""
    sys.meta_path.insert(0, _Finder(name))
    signal.alarm(A_DAY_S)
    from tests.system.day.day import day

    for seed in range(seeds):
        signal.alarm(A_DAY_S)
        try:
            day(seed)
        except AssertionError as error:
            print(f"seed {seed}: {str(error).splitlines()[0][:150]}")
            sys.exit(1)


def found_by_days(mutant: Mutant, seeds: int) -> str:
    """Return how the days find `mutant`, empty if they do not."""
    command = [sys.executable, "-m", "tests.system.day.mutants", "--one", mutant.name]
    done = subprocess.run(
        [*command, "--seeds", str(seeds)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.returncode == 0:
        return ""
    said = (done.stdout or done.stderr).strip().splitlines()
    return said[-1] if said else f"does not end ({done.returncode})"


def found_by_tests(mutant: Mutant) -> bool:
    """Return whether the ordinary tests find `mutant`."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "tests.system.day.mutants"]
    environment = {**os.environ, _MUTANT: mutant.name}
    done = subprocess.run(
        [*command, *ORDINARY], cwd=ROOT, capture_output=True, env=environment, check=False
    )
    return done.returncode != 0


def main() -> None:
    """Draw mutants, run days with each, and list those that survive."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--ordinary", action="store_true")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        _days(options.one, options.seeds)
        return
    drawn = random.Random(SEED).sample(mutants(), options.count)
    survivors = []
    with ThreadPoolExecutor(options.processes) as pool:
        found = pool.map(lambda mutant: found_by_days(mutant, options.seeds), drawn)
        for mutant, how in zip(drawn, found, strict=True):
            print(f"{mutant}\n    {how or 'SURVIVES'}", flush=True)
            survivors += [] if how else [mutant]
    print(f"{len(drawn) - len(survivors)} of {len(drawn)} found")
    for mutant in survivors if options.ordinary else ():
        tested = found_by_tests(mutant)
        print(f"{mutant}: {'ordinary tests find it' if tested else 'nothing finds it'}", flush=True)


if __name__ == "__main__":
    main()
