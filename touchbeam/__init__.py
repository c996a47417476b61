"""touchbeam in Python: a study's data as data frames, its report, the friction model, the rig.

>>> import touchbeam
>>> float(touchbeam.friction(voltage_v=0))
0.4

'touchbeam in Python' (touchbeam docs) shows the rest. Only `open_rig` drives anything or writes to
a journal.
"""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from touchbeam.model import fit, friction, predict
    from touchbeam.rig import OpenRig, open_rig
    from touchbeam.study import Study, load
    from touchbeam.tracks import track

    __version__: str

__all__ = ["OpenRig", "Study", "__version__", "fit", "friction", "load"]
__all__ += ["open_rig", "predict", "track"]

_NAMES = {
    "study": ("Study", "load"),
    "model": ("friction", "predict", "fit"),
    "rig": ("OpenRig", "open_rig"),
    "tracks": ("track",),
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}


def _require_own_packages() -> None:
    """Refuse to go on with another package under a name of touchbeam's own, which are common."""
    ours = Path(__file__).resolve().parent.parent
    for name in ("protocol", "device", "runner", "analysis"):
        spec = find_spec(name)
        found = Path(spec.origin).resolve() if spec and spec.origin else None
        if found != ours / name / "__init__.py":
            raise ImportError(
                f"touchbeam needs its own package {name!r} in {ours}, but Python finds "
                f"{found or 'none'} under that name; rename that one, start Python in another "
                "folder, or install touchbeam in an environment without it",
                name=name,
            )


def __getattr__(name: str) -> Any:
    """Return a public name when it is first asked for, so that commands start without it.

    Raises:
        ImportError: another package hides one of touchbeam's own. `touchbeam doctor` tells it, too,
            so that it must not stop the import of this package.
    """
    if name == "__version__":
        from importlib.metadata import version

        return version("touchbeam")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    _require_own_packages()
    # From now on Python finds it without asking here, which takes longer than a prediction.
    found = globals()[name] = getattr(import_module(f"touchbeam.{_HOME[name]}"), name)
    return found
