"""The build backend, hatchling, with the documentation's site in each wheel.

An editable installation, which `make` and `uv sync` make, gets no site and needs no Zensical.
"""

import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import hatchling.build
from hatchling.build import *  # noqa: F403 - a backend has what hatchling has
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACE = "touchbeam/documentation"


def get_requires_for_build_wheel(  # type: ignore[no-redef]
    config_settings: dict[str, Any] | None = None,
) -> list[str]:
    """Return what hatchling needs, and what builds the site.

    A hook's own list of requirements would be asked of editable installations, too.
    """
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))
    site: list[str] = project["dependency-groups"]["site"]
    return [*hatchling.build.get_requires_for_build_wheel(config_settings), *site]


class Documentation(BuildHookInterface):  # type: ignore[type-arg]
    """Builds the site for each wheel that is not editable."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the site in a folder of its own, because the source may not be writable."""
        if version == "editable":
            return
        self._folder = TemporaryDirectory()
        build = [sys.executable, "-m", "handbook.build", self._folder.name]
        subprocess.run(build, cwd=self.root, check=True, stdout=sys.stderr)
        build_data["force_include"][f"{self._folder.name}/site"] = PLACE

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove the folder, which the wheel holds now."""
        if version != "editable":
            self._folder.cleanup()
