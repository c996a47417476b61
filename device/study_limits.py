"""Places of a study that a finger cannot touch, for the beam ends before them."""

from collections.abc import Iterator

from device.beam.beam import Beam
from protocol.errors import Path, Problem
from protocol.study.study import Study


def reach_problems(study: Study) -> Iterator[Problem]:
    """Yield every place of `study` that lies beyond the end of the beam."""
    length_m = Beam().length_m
    for path, place_m in _places(study):
        if place_m > length_m:
            yield Problem(
                where=".".join(map(str, path)),
                rule=f"must lie on the beam, which ends at {length_m:g} m",
                value=f"{place_m!r} m",
                hint=f"that is {1e3 * place_m:.12g} mm; the beam is {1e3 * length_m:g} mm long",
                path=path,
            )


def _places(study: Study) -> Iterator[tuple[Path, float]]:
    for number, place_m in enumerate(study.touch.path_m):
        yield ("touch", "path_m", number), place_m
    yield ("touch", "smooth_place_m"), study.touch.smooth_place_m
