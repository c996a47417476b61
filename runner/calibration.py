"""The rig's calibration: the resonance that a sweep found, kept in the study's folder."""

import json
import math
from dataclasses import asdict
from pathlib import Path

from device.sweep import Resonance
from protocol.errors import BadInput

FILE = "calibration.json"


def keep_calibration(folder: Path, found: Resonance, idn: str, measured_utc: str) -> Path:
    """Write what a sweep found into the study's folder; return the file.

    Raises:
        BadInput: there is no study in `folder`.
    """
    if not (folder / "study.toml").is_file():
        raise BadInput(f"{folder}: no study here (study.toml is missing)")
    path = folder / FILE
    record = {**asdict(found), "idn": idn, "measured_utc": measured_utc}
    path.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    return path


def kept_calibration(folder: Path) -> Resonance | None:
    """Return the calibration that is kept in the study's folder, None if there is none.

    Raises:
        BadInput: the file is not one that `keep_calibration` wrote.
    """
    path = folder / FILE
    if not path.exists():
        return None
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        found = Resonance(
            frequency_hz=float(kept["frequency_hz"]), tip_m_per_v=float(kept["tip_m_per_v"])
        )
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{path}: not a calibration ({error!r}); measure it anew") from error
    if not (math.isfinite(found.frequency_hz) and found.frequency_hz > 0):
        raise BadInput(f"{path}: frequency_hz must be above 0, got {found.frequency_hz}")
    return found
