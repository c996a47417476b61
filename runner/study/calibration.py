"""The rig's calibration, kept in the study's folder: a sweep's resonance, and what a slide told.

One file has both. A sweep replaces its own part, a sliding experiment replaces `fitted`.
"""

import json
import math
from collections.abc import Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from device.errors import OutOfRangeError
from device.friction.calibration import Calibration
from device.friction.surfaces import BeamSurface, GivenSurface, MeasuredSurface
from protocol.errors import IMPOSSIBLE, BadInput, shown
from protocol.study.study import Study
from protocol.study.surface import GEOMETRY, Surface
from runner.study.files import own_file, require_no_link, short_text, write_whole
from runner.study.surface import surface_of

if TYPE_CHECKING:
    from device.resonance import Resonance
    from protocol.journal.events import ResonanceMeasured

FILE = "calibration.json"
FITTED = "fitted"
BEAM = "surface_sha256"
PREDICTING = ("damping_ratio", "gain", "body_height_m", "resonance_hz")
"""The fitted properties that predictions take. Friction at rest is the block's, not the finger's;
of the patches predictions take the place that is described."""


def keep_calibration(folder: Path, swept: "Resonance", idn: str, measured_utc: str) -> Path:
    """Store a sweep in the study's folder; raise `BadInput` without a study, or as `own_file`."""
    measured = {"frequency_hz": swept.frequency_hz, "tip_m_per_v": swept.tip_m_per_v}
    return _write(folder, {**measured, "idn": idn, "measured_utc": measured_utc})


def keep_fit(
    folder: Path, measured: "ResonanceMeasured", idn: str, fitted: Mapping[str, object]
) -> Path:
    """Store what a slide determined of the rig, the `calibration_record` of its findings.

    Without a sweep's resonance, the one `measured` by the device `idn` at its beginning is kept.
    Raise `BadInput` as `keep_calibration`, and for a rehearsal that would replace the fit of a rig.
    """
    path, is_rehearsal = folder / FILE, bool(fitted.get("rehearsal"))
    # What a damaged file held may have been of a rig, which only a rig's own replaces.
    kept = _kept(path) or {} if is_rehearsal else _kept_or_nothing(path)
    before = kept.get(FITTED)
    # The values of a simulated rig would quietly replace those of a real one.
    if is_rehearsal and isinstance(before, dict) and not before.get("rehearsal"):
        raise BadInput(
            f"{folder / FILE}: the fit of session {before.get('session')} is not replaced by a "
            "rehearsal's; move the file away if it should be"
        )
    part: dict[str, object] = {FITTED: dict(fitted)}
    # Only a sweep writes `measured_utc`, and its resonance stays. Another one, written by hand for
    # example, is not replaced by a rehearsal's.
    if "measured_utc" not in kept and not (is_rehearsal and "frequency_hz" in kept):
        resonance = {"frequency_hz": measured.frequency_hz, "tip_m_per_v": measured.tip_m_per_v}
        part = {**resonance, "idn": idn, **part}
    return _write(folder, part)


def beam_of(surface: Surface) -> dict[str, str]:
    """Return what a fit keeps of a beam that a study describes; nothing of the paper's.

    It is the digest of its description, but for the damping, which the fit replaces.
    """
    if not surface.is_own_beam:
        return {}
    described = surface.model_dump(mode="json", include=set(GEOMETRY) - {"damping_ratio"})
    return {BEAM: sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()}


def _write(folder: Path, part: Mapping[str, object]) -> Path:
    if not (folder / "study.toml").is_file():
        raise BadInput(f"{folder}: no study here (study.toml is missing)")
    path = own_file(folder / FILE, folder)
    text = json.dumps({**_kept_or_nothing(path), **part}, indent=2) + "\n"
    write_whole(path, text.encode())
    return path


def kept_calibration(folder: Path) -> "Resonance | None":
    """Return the resonance stored in the study's folder, if any; `BadInput` if it is damaged."""
    from device.resonance import Resonance

    path = folder / FILE
    kept = _kept(path)
    if kept is None:
        return None
    found = {key: _number(path, kept, key) for key in ("frequency_hz", "tip_m_per_v")}
    for key, value in found.items():
        if value <= 0:
            raise BadInput(f"{path}: {key} must be above 0, got {value}; measure it again")
    return Resonance(frequency_hz=found["frequency_hz"], tip_m_per_v=found["tip_m_per_v"])


def fitted_calibration(folder: Path, study: Study) -> Calibration:
    """Return the rig of a study as a slide determined it, or its surface's own values.

    Raise `BadInput` for a damaged file, also of a table of friction, and for the fit of another
    beam than the study's.
    """
    path, surface = folder / FILE, surface_of(folder, study)
    fitted = (_kept(path) or {}).get(FITTED)
    if fitted is None or isinstance(surface, GivenSurface):
        return Calibration.of(surface)
    try:
        values = {
            name: _number(path, fitted[name], "value", f"{FITTED}.{name}.")
            for name in PREDICTING
            if name in fitted
        }
        if isinstance(surface, BeamSurface):
            _require_same_beam(path, fitted, study)
        # Reports name it, so that a value that was edited shows.
        digest = sha256(json.dumps(fitted, sort_keys=True).encode()).hexdigest()
        session = f"session {fitted['session']}{', a rehearsal' * bool(fitted.get('rehearsal'))}"
        origin = f"{session}, calibration SHA-256 {digest[:12]}"
        if isinstance(surface, MeasuredSurface):  # which has no model to be fitted
            values = {name: values[name] for name in ("resonance_hz",) if name in values}
        return Calibration.of(surface, **values, origin=origin)
    except OutOfRangeError as error:
        raise BadInput(f"{path}: {FITTED}: {error}") from error
    except BadInput:  # a number, which is named
        raise
    except IMPOSSIBLE as error:
        raise _damaged(path, f"{FITTED} is not what a slide has told") from error


def _require_same_beam(path: Path, fitted: Mapping[str, Any], study: Study) -> None:
    if fitted.get(BEAM) != beam_of(study.surface).get(BEAM):
        raise BadInput(
            f"{path}: {FITTED} is of another beam than [surface] describes; move the file away, "
            "or fit this beam with touchbeam slide --calibrate"
        )


def _kept_or_nothing(path: Path) -> dict[str, Any]:
    """Return what the file contains; a damaged one counts as empty, because it is replaced."""
    with suppress(BadInput):
        return _kept(path) or {}
    return {}


def _kept(path: Path) -> dict[str, Any] | None:
    if not path.exists():
        return None
    try:
        require_no_link(path)
        kept = json.loads(short_text(path))
        return dict(kept.items())
    except BadInput:
        raise
    except IMPOSSIBLE as error:
        raise _damaged(path, "it must be a JSON object") from error


def _number(path: Path, held: Any, key: str, within: str = "") -> float:
    """Return the finite number that the file has there, or raise `BadInput`."""
    value: Any = held.get(key) if isinstance(held, Mapping) else held
    number = math.nan
    with suppress(*IMPOSSIBLE):
        number = float(value)
    if not math.isfinite(number):
        raise _damaged(path, f"{within}{key} must be a finite number, got {shown(value)}")
    return number


def _damaged(path: Path, why: str) -> BadInput:
    return BadInput(f"{path}: not a calibration ({why}); measure it again")
