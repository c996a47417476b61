"""What `touchbeam check` says of tracks: levels, voltages, convergence, expected precision."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from device.friction.calibration import Calibration
from protocol.errors import BadInput, Problem
from protocol.study.study import Study
from protocol.study.touch import Touch, current_ma
from protocol.study.track import Track
from protocol.tracks.procedure import converges_at, staircase

if TYPE_CHECKING:
    from device.tracks.expected import Expected

FELT = 0.01
"""A smaller change of ln friction is none: nobody feels a hundredth."""
_WAYS = {"smoother": 1.0, "rougher": -1.0}
"""In which direction the friction of what is to be found differs."""
_UNITS = {"voltage": " V", "frequency": " of the resonance", "contrast": "", "place": " m"}


@dataclass(frozen=True, kw_only=True)
class ShownTrack:
    """A track with the voltage of each level, and what it is expected to tell."""

    track: Track
    volts: tuple[float, ...]
    contrasts: tuple[float, float] | None
    current_ma: float | None
    converges_at: float | None
    expected: "Expected"

    def touches(self) -> Iterator[Touch]:
        """Yield the comparison at each level."""
        return map(self.track.at, range(len(self.volts)), self.volts)

    def record(self) -> dict[str, Any]:
        track, share = self.track, self.converges_at
        return {
            "name": track.name,
            "task": track.task,
            "method": track.method,
            "axis": track.axis,
            "levels": list(track.values),
            "volts": list(self.volts),
            "contrasts": self.contrasts and [round(end, 4) for end in self.contrasts],
            "trials": track.trials,
            "catch": track.catch,
            "easy": track.easy,
            "threshold_at": round(track.share, 4),
            "converges_at": None if share is None else round(share, 4),
            "expected": {
                "rmse_db": round(self.expected.rmse_db, 2),
                "interval_db": round(self.expected.interval_db, 2),
                "trials": round(self.expected.trials, 1),
            },
        }

    def contradictions(self) -> Iterator[str]:
        """Yield that the model predicts another answer than the one which counts as right."""
        ways = _WAYS.get(self.track.found)
        if self.contrasts is None or ways is None:
            return
        largest = max(ways * contrast for contrast in self.contrasts)
        if largest < FELT:
            yield (
                f"track {self.track.name}: {self.track.found} is to be found, but the model "
                f"predicts a change of at most {largest:+.3f} in that direction at any level, "
                "which nobody feels."
            )

    def lines(self) -> Iterator[str]:
        track, s = self.track, "s" * (self.track.trials > 1)
        beside = [f"{many} {kind}" for kind in ("catch", "easy") if (many := getattr(track, kind))]
        yield f"Track       {track.name}: {track.task}, {track.method}, " + " + ".join(
            [f"{track.trials} trial{s}", *beside]
        )
        levels, unit = track.values, _UNITS[track.axis]
        drives = "" if track.axis == "voltage" else f"; {_range(self.volts)} V"
        felt = "" if self.contrasts is None else f"; contrast {_range(self.contrasts, 3)}"
        current = "" if self.current_ma is None else f"; up to {self.current_ma:.3g} mA"
        yield (
            f"            {len(levels)} levels of {track.axis}, {_range(levels)}{unit}"
            f"{drives}{felt}{current}"
        )
        if self.converges_at is not None:
            yield f"            its rule converges to {self.converges_at:.4f} correct"
        said = "yes" if track.task == "yes or no" else "correct"
        yield f"            threshold at {track.share:.4g} {said}, as 200 simulated observers show:"
        told = self.expected
        yield (
            f"            about {told.rmse_db:.1f} dB (RMSE) after {told.trials:.0f} trial{s}, "
            f"95% interval {told.interval_db:.1f} dB wide"
        )


def _range(values: tuple[float, ...], digits: int = 4) -> str:
    ends = f"{min(values):.{digits}g}", f"{max(values):.{digits}g}"
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def volts_of(
    study: Study, number: int, rig: Calibration
) -> tuple[tuple[float, ...], list[Problem]]:
    """Return the voltage of each level of a track on this rig, and what is wrong with them."""
    track = study.track[number]
    if track.axis == "contrast":
        from device.tracks.contrast import voltages

        return voltages(study, number, rig)
    return tuple(track.at(level).voltage_v for level in range(len(track.values))), []


def solved_volts(study: Study, rig: Calibration) -> dict[str, tuple[float, ...]]:
    """Return the voltages of the levels of each track on the axis of contrast, by its name.

    Raise `BadInput` if a contrast cannot be reached on this rig.
    """
    found = {}
    for number, track in enumerate(study.track):
        if track.axis == "contrast":
            found[track.name], wrong = volts_of(study, number, rig)
            if wrong:
                raise BadInput(str(wrong[0]))
    return found


def shown_tracks(study: Study, rig: Calibration) -> tuple[list[ShownTrack], list[Problem]]:
    """Return all tracks of a checked study as shown, and what only the friction model finds."""
    shown: list[ShownTrack] = []
    wrong: list[Problem] = []
    for number, track in enumerate(study.track):
        volts, broken = volts_of(study, number, rig)
        wrong += broken
        if not broken:
            shown.append(_shown(study, track, volts, rig))
    return shown, wrong


def _shown(study: Study, track: Track, volts: tuple[float, ...], rig: Calibration) -> ShownTrack:
    from device.friction.changes import friction_difference
    from device.tracks.expected import expected

    touches = [track.at(level, volts[level]) for level in (0, len(volts) - 1)]
    contrasts = None
    if track.standard is not None and track.axis != "place":
        ends = [friction_difference(study, track.standard, touch, rig) + 0.0 for touch in touches]
        contrasts = (ends[0], ends[1])
    highest_hz = max(touch.frequency for touch in touches) * study.rig.nominal_resonance_hz
    sheets_nf = study.rig.capacitance_nf
    return ShownTrack(
        track=track,
        volts=volts,
        contrasts=contrasts,
        current_ma=sheets_nf and current_ma(max(volts), highest_hz, sheets_nf),
        converges_at=converges_at(staircase(track)) if track.method == "staircase" else None,
        expected=expected(track),
    )
