"""Where a report comes from: its input, the versions and seeds at work, the model's parameters."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version

from analysis.loading.study_data import Loaded, changed_journal
from analysis.trials.arrays import LAW
from analysis.trials.contrasts import RUNG
from device.friction.laws import LAWS
from device.friction.scenes import REFERENCE_SPEED_M_S, REFERENCE_TIP_SPEED_M_S, Scene
from protocol.study.study import Study

LIBRARIES = ("touchbeam", "numpy", "scipy", "matplotlib")


@dataclass(frozen=True, kw_only=True)
class Origin:
    """What a report was asked for with, and the digest of the study file.

    `broken_chains` are the sessions whose events are not as they were recorded.
    """

    command: str
    study_sha256: str
    broken_chains: tuple[str, ...] = ()


def provenance(origin: Origin, loaded: Loaded, study: Study, trials_sha256: str) -> dict[str, str]:
    """Return what a reader needs to make the report again, name by name.

    Args:
        origin: what was asked for.
        loaded: what was found.
        study: the study file's content.
        trials_sha256: digest of the trials that count, with their predictions.
    """
    recording = loaded.recording
    return {
        "command": origin.command,
        **({"journal": changed_journal(origin.broken_chains)} if origin.broken_chains else {}),
        "scores": ", ".join(loaded.kinds),
        "input, SHA-256 of all trials that count": trials_sha256,
        "study file, SHA-256": origin.study_sha256,
        "sessions recorded under": _recorded_under(origin, loaded),
        "imported from": "; ".join(recording.sources) or "nothing imported",
        "versions": ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
        + f", python {platform.python_version()}",
        "versions that recorded": "; ".join(recording.versions) or "none: imported",
        "seeds": f"design {study.study.seed}; sessions "
        + (", ".join(map(str, recording.seeds)) or "none")
        + "; the analysis draws nothing at random",
        "model parameters": ", ".join(
            f"{name} {value}" for name, value in model_parameters(study).items()
        ),
    }


def _recorded_under(origin: Origin, loaded: Loaded) -> str:
    others = [digest for digest in loaded.recording.studies if digest != origin.study_sha256]
    if not loaded.recording.studies:
        return "no study file: imported"
    if not others:
        return "this study file"
    return "other versions of the study file too, SHA-256 " + ", ".join(others)


def model_parameters(study: Study) -> Mapping[str, str]:
    """Return the parameters of the friction model, with their units."""
    scene, finger = Scene(), study.touch
    beam = scene.structure.beam
    return {
        "laws": " / ".join(LAWS),
        "law for sensitivities": LAW,
        "rung": RUNG,
        "mode": str(scene.drive.mode),
        "beam": f"{beam.length_m:g} m x {beam.width_m:g} m x {beam.thickness_m:g} m",
        "damping ratio": f"{beam.damping_ratio:g}",
        "body height": f"{scene.structure.body_height_m:g} m",
        "body mass": f"{scene.structure.body_mass_kg:g} kg/m",
        "friction coefficient, drive off": f"{scene.structure.friction_coefficient:g}",
        "reference tip speed": f"{REFERENCE_TIP_SPEED_M_S:.6g} m/s",
        "reference sliding speed": f"{REFERENCE_SPEED_M_S:.6g} m/s",
        "finger force": f"{finger.force_n:g} N",
        "finger contact": f"{finger.contact_m:g} m",
        "sliding speed": f"{finger.sliding_speed_m_s:g} m/s",
        "smooth place": f"{finger.smooth_place_m:g} m",
        "path": f"{finger.path_m[0]:g} to {finger.path_m[1]:g} m",
    }
