"""Lets Python import one module with a small error in it.

The environment says which, so that every process that a test starts has the same error: the folder
`site` beside this file makes Python load this hook as it starts.
"""

import importlib.abc
import importlib.machinery
import importlib.util
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

from tests.mutants.mutation import ROOT, mutated_module

VARIABLE = "TOUCHBEAM_MUTANT"


def install(name: str) -> None:
    """Import the module of the mutant `name` with its change, from now on."""
    sys.meta_path.insert(0, _Finder(name))


def environment(name: str) -> Mapping[str, str]:
    """Return the environment in which each Python has the mutant `name`."""
    paths = (str(Path(__file__).with_name("site")), str(ROOT))
    # What another mutant, or none, has computed would hide this one.
    own = {VARIABLE: name, "PYTHONPATH": os.pathsep.join(paths)}
    return {**os.environ, **own}


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def __init__(self, name: str) -> None:
        self._name = name
        path, _, _ = name.partition(":")
        self._path = ROOT / path
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
        exec(compile(mutated_module(self._name), str(self._path), "exec"), vars(module))
