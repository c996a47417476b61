"""Provenance of the report: input, versions, seeds and parameters of the model."""

import json
import platform
from hashlib import sha256
from importlib.metadata import version

from analysis.loading.study_data import StudyData, changed_journal
from analysis.report.blocks import Definitions, Section
from analysis.report.findings import Findings, Origin
from analysis.sensitivity.predictive_checks import SEED
from device.friction.calibration import Calibration
from device.friction.contrasts import LAW, RUNG
from device.friction.laws import LAWS
from device.friction.scenes import REFERENCE_SPEED_M_S, REFERENCE_TIP_SPEED_M_S, Scene
from protocol.study.study import Study

_LIBRARIES = ("touchbeam", "numpy", "scipy", "matplotlib")


def section(found: Findings) -> Section:
    """Return the facts needed to reproduce the report."""
    facts = _provenance(found)
    return Section(
        name="provenance",
        title="Provenance",
        blocks=[Definitions(entries=facts)],
        data={"provenance": facts},
    )


def _provenance(found: Findings) -> dict[str, str]:
    origin, study, recording = found.origin, found.study, found.loaded.recording
    trials = json.dumps(found.trial_records, ensure_ascii=False)
    return {
        "command": origin.command,
        **({"journal": changed_journal(origin.broken_chains)} if origin.broken_chains else {}),
        "scores": ", ".join(found.loaded.kinds),
        "input, SHA-256 of all trials that count": sha256(trials.encode()).hexdigest(),
        "study file, SHA-256": origin.study_sha256,
        "sessions recorded under": _recorded_under(origin, found.loaded),
        "imported from": "; ".join(recording.sources) or "nothing imported",
        "versions": ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
        + f", python {platform.python_version()}",
        "versions that recorded": "; ".join(recording.versions) or "none: imported",
        "seeds": f"design {study.study.seed}; sessions "
        + (", ".join(map(str, recording.seeds)) or "none")
        + f"; permutations and predictive checks {SEED}",
        "model parameters": ", ".join(
            f"{name} {value}" for name, value in _model_parameters(study, origin.rig).items()
        ),
    }


def _recorded_under(origin: Origin, loaded: StudyData) -> str:
    others = [digest for digest in loaded.recording.studies if digest != origin.study_sha256]
    if not loaded.recording.studies:
        return "no study file: imported"
    if not others:
        return "this study file"
    return "also other versions of the study file, SHA-256 " + ", ".join(others)


def _model_parameters(study: Study, rig: Calibration) -> dict[str, str]:
    """Return the parameters of the friction model, with units."""
    scene, finger = Scene(), study.touch
    beam = scene.structure.beam
    return {
        "laws": " / ".join(LAWS),
        "law for sensitivities": LAW,
        "rung": RUNG,
        "mode": str(scene.drive.mode),
        "beam": f"{beam.length_m:g} m x {beam.width_m:g} m x {beam.thickness_m:g} m",
        "damping ratio": f"{rig.damping_ratio:g}",
        "body height": f"{rig.body_height_m:g} m",
        **({"gain of the drive": f"{rig.gain:g}", "rig": rig.origin} if rig.origin else {}),
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
