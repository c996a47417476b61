"""`touchbeam check`: the problems of a study, or its plan."""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from math import inf, isnan
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from device.friction.calibration import Calibration
from device.study_limits import reach_problems
from protocol.address import other_spelling
from protocol.errors import BadInput, Problem, WorkFailed, listed
from protocol.plan.plan import plan
from protocol.plan.trials import Trial
from protocol.preview.preview import Prediction, Resonance, preview, preview_record
from protocol.preview.text import preview_lines
from protocol.proof.trial_checks import cohort_problems, cycle
from protocol.study.participant_texts import read_in_reference, scale_in_words, worded_as_built
from protocol.study.rules import selections
from protocol.study.study import Study
from protocol.study.study_question import Question
from protocol.study.touch import Touch
from protocol.study_file.limits import problems_at
from protocol.study_file.loading import StudyError, located, parsed_study, text_digest
from runner.study.calibration import fitted_calibration, kept_calibration
from runner.study.folder import DIALECTS, StudyFolder
from runner.study.tracks import FELT

if TYPE_CHECKING:
    from device.friction.changes import Change
    from protocol.registration.registration import Registration
    from runner.study.tracks import ShownTrack


class WrongPlan(WorkFailed):
    """A plan that does not follow from its study: an error of touchbeam, not of the study."""


Contrast = Callable[[Question | None, str | None, tuple[Touch, ...]], float | None]
"""The predicted contrast of a question about touches, with what is expected, or what a rating of
them follows without a question; None of none."""


def validated_study(text: str, source: str) -> Study:
    """Return the study in `text`, checked for all that a session needs, or raise `StudyError`."""
    return parsed_study(text, source, _placement_problems, DIALECTS)


def runnable_study(text: str, source: str) -> Study:
    """Return the validated study; `BadInput` if it describes imported scores."""
    study = validated_study(text, source)
    if study.imported:
        raise BadInput(
            f"{source}: describes imported scores and cannot be run or registered, as no condition "
            "has touches; touchbeam new makes a study to run"
        )
    return study


def proved_study(text: str, source: str) -> Study:
    """Return the validated study; `WrongPlan` if the proof finds an error in the plans it gives.

    A study of imported scores has no plans.
    """
    study = validated_study(text, source)
    if study.imported:
        return study
    # One whole cycle, because the balance of carry-over can only be proved over all of its slots.
    plans = [
        replace(plan(study.of_group(group), slot), group=group)
        for group in study.groups or (None,)
        for slot in cycle(study, 0)
    ]
    require_proved(source, cohort_problems(study, plans))
    return study


def require_proved(what: str, problems: Sequence[Problem]) -> None:
    """Refuse to go on with `what` if the proof of its plans has found anything."""
    if problems:
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise WrongPlan(
            f"{what}: touchbeam drew a wrong plan: {problems[0]}{more}; nothing was driven or "
            "recorded. This is an error of touchbeam: report it with study.toml, and use another "
            "version until it is mended"
        )


def _placement_problems(study: Study) -> Iterator[Problem]:
    # Not in the schema: an older study that names a device so must still be read.
    addresses = {"rig.device": study.rig.device, "force_channel.gauge": study.force_channel.gauge}
    for key, address in addresses.items():
        if spelling := other_spelling(address or ""):
            yield Problem.of_key(
                key, "must be the address of a device", repr(address), f"it {spelling}"
            )
    yield from reach_problems(study)
    if "surface" in study.model_fields_set:  # the solver of beams takes a while to load
        from device.friction.surface_checks import surface_problems

        yield from surface_problems(study)
    if not worded_as_built(study):  # the built-in texts are known to fit
        from runner.window.preflight import fit_problems

        yield from fit_problems(study)


def checked(
    folder: StudyFolder, participants: int | None, *, as_json: bool
) -> tuple[list[str], list[str]]:
    """Return the lines to print, and the problems as lines: none, if the study is valid.

    Drives are those at the resonance that a session will have, as far as it is known.
    The cohort has `participants`, by default the study's own, or else 1. With `as_json` the lines
    are one document. Raise `BadInput` if the study file is missing or unreadable.
    """
    source, text = str(folder.study_file), folder.text()
    try:
        valid = validated_study(text, source)
        if valid.imported:
            return _imported_lines(valid, as_json=as_json), []
        rig = fitted_calibration(folder.path, valid)
        study, resonance = _at_kept_resonance(folder, valid, source)
        _require_in_table(study, rig, source, text)
        tracks = _tracks(study, rig, source, text)
    except StudyError as error:
        return _refused(source, error.problems, as_json=as_json)
    if not worded_as_built(study):
        # Of this computer's window, so that a study that is refused can still be read and reported.
        from runner.window.preflight import writing_problems

        if undrawn := list(writing_problems(study)):
            return _refused(source, located(text, undrawn), as_json=as_json)
    registered = None
    # Journals and registrations take long to import, and a study has neither while it is written.
    if folder.journal.is_file() or (folder.path / "registration.toml").exists():
        from protocol.registration.registration import locked
        from runner.study.registered import checked_registration

        # The registration seeds the orders: without it the plans shown would not be those run.
        registered = checked_registration(folder)
        study = locked(study, registered.digest if registered else None)
    size = participants or study.design.participants or 1
    at_levels = (touch for track in tracks for touch in track.touches())
    shown = preview(study, size, at_levels, resonance)
    broken = cohort_problems(study, shown.plans)
    if broken:
        return _refused(source, located(text, broken), as_json=as_json)
    contrast = _contrast_of(study, rig)
    model = _prediction(study, contrast, rig)
    warnings = _warnings(study, rig, contrast, tracks)
    if as_json:
        record = {"ok": True, "problems": [], **preview_record(shown, model)}
        record["tracks"] = [track.record() for track in tracks]
        record["surface"] = _surface_record(study, rig)
        record["exclusions"] = selections(study.exclusions, asked=not study.absolute)
        record["warnings"] = warnings
        lock = {} if registered is None else {"registration": registered.digest}
        return [_json({**record, **lock})], []
    said = [*preview_lines(shown, model), *_surface_lines(study, rig), *[""] * bool(tracks)]
    said += [line for track in tracks for line in track.lines()]
    said += _exclusion_lines(study)
    said += [line for warning in warnings for line in ("", *wrap(f"Warning: {warning}", 80))]
    said += _lock_lines(folder, registered, text)
    said += [
        f"texts/{code}.toml lacks {', '.join(keys)}: read in English until they are added."
        for code in study.languages
        if (keys := read_in_reference(study, code))
    ]
    return said, []


def _imported_lines(study: Study, *, as_json: bool) -> list[str]:
    """Return what is said of a study that describes imported scores: nothing of it can be run."""
    contrasts = {each.name: each.contrast for each in study.condition if each.contrast is not None}
    if as_json:
        known = {"conditions": study.conditions, "factors": study.factors, "groups": study.groups}
        record = {"ok": True, "problems": [], "participants": [], "warnings": []}
        return [_json({**record, "imported": {**known, "contrasts": contrasts}})]
    lines = [
        "Imported    this study describes imported scores and cannot be run",
        f"Conditions  {listed(study.conditions)}",
        f"Scale       {scale_in_words(study, study.rating)}",
    ]
    for name, levels in study.factors.items():
        lines.append(f"Factor      {name}: {listed(levels)}")
    if study.groups:
        lines.append(f"Groups      {listed(study.groups)}")
    told = listed(f"{name} {value:+g}" for name, value in contrasts.items())
    return [*lines, f"Contrasts   {told or 'none predicted: contrast = ... in [[condition]]'}"]


def _of_the_papers_beam(study: Study) -> list[str]:
    """Return what a study of another surface leaves as it is for the paper's beam."""
    full = any(touch.coverage == "full" for it in study.condition for touch in it.touches)
    keys = ("welcome", "stopped", *["touch.full"] * full)
    texts = [
        f"texts.{code}.{key}"
        for code in study.session.languages
        if code not in study.languages
        for key in keys
        if key not in study.texts.get(code, {})
    ]
    warnings = []
    if texts:
        warnings.append(
            f"texts that participants read speak of a beam: give {listed(texts)} of your own."
        )
    if "nominal_resonance_hz" not in study.rig.model_fields_set:
        hz = study.rig.nominal_resonance_hz
        warnings.append(
            f"rig.nominal_resonance_hz is not given: the resonance is looked for near {hz:g} Hz, "
            "that of the paper's beam."
        )
    return warnings


def _warnings(
    study: Study, rig: Calibration, contrast: Contrast, tracks: "Sequence[ShownTrack]"
) -> list[str]:
    """Return what its author should know of a study: of the surface, and of expected answers."""
    from device.friction.changes import trial_change

    warnings: list[str] = []
    if "surface" in study.model_fields_set:  # the solver of beams takes a while to load
        from device.friction.surface_checks import surface_warnings

        warnings += surface_warnings(study, rig.surface)
    if study.surface.kind != "beam" and not study.imported:
        warnings += _of_the_papers_beam(study)
    openings = ((f"opening {it.kind}", it) for it in study.opening)
    for what, item in (*((f"condition {it.name}", it) for it in study.condition), *openings):
        if item.question is None:
            continue
        asked = item.question, item.expected, item.touches
        predicted = contrast(*asked)
        if predicted is not None and predicted < -FELT:
            change = trial_change(study, *asked)
            warnings.append(
                f"{what}: {item.expected} is expected, but friction is predicted to change the "
                f"other way, by {predicted:+.3f} in its logarithm{_elsewhere(study, change, rig)}."
            )
    return warnings + [line for track in tracks for line in track.contradictions()]


_SEARCHED = 121
_MOST_NAMED = 3


def _elsewhere(study: Study, change: "Change", rig: Calibration) -> str:
    """Return at which places of the path friction changes most as expected, in words."""
    from device.friction.changes import predicted_contrast

    if len(change.places_m) > 1:
        return ""
    left_m, right_m = study.touch.path_m
    places_m = [left_m + part * (right_m - left_m) / (_SEARCHED - 1) for part in range(_SEARCHED)]
    sizes = [predicted_contrast(replace(change, places_m=(at,)), rig=rig) for at in places_m]
    around = zip(places_m, sizes, [-inf, *sizes], [*sizes[1:], -inf], strict=False)
    peaks = sorted((-size, at) for at, size, *beside in around if size > max(FELT, *beside))
    if not peaks:
        return "; nowhere on touch.path_m does it change as expected"
    best = ", ".join(f"{at:.4f}" for _, at in peaks[:_MOST_NAMED])
    return f"; on touch.path_m it changes most as expected at {best} m (touch.smooth_place_m)"


def _surface_record(study: Study, rig: Calibration) -> dict[str, Any]:
    from device.friction.surface_checks import beam_facts
    from device.friction.surfaces import BeamSurface, length_of

    record: dict[str, Any] = {"kind": study.surface.kind, "length_m": length_of(study.surface)}
    if isinstance(rig.surface, BeamSurface):
        facts = beam_facts(rig.surface, study.rig.nominal_resonance_hz)
        record |= {
            "resonance_hz": round(facts.resonance_hz, 3),
            "mode": facts.mode,
            "share": round(facts.share, 4),
            "modes_hz": [round(hz, 3) for hz in facts.modes_hz],
        }
    return record


def _surface_lines(study: Study, rig: Calibration) -> Iterator[str]:
    """Yield what is touched, as it was understood."""
    yield ""
    if "surface" not in study.model_fields_set:
        yield "Surface     the paper's beam; [surface] describes another"
        return
    from device.friction.surfaces import BeamSurface

    if not isinstance(rig.surface, BeamSurface):
        source = {"measured": f"friction from {study.surface.table}"}
        known = source.get(study.surface.kind, _stated(study))
        yield f"Surface     {study.surface.kind}, {1e3 * rig.surface.length_m:g} mm long; {known}"
        return
    record, beam = _surface_record(study, rig), rig.structure.beam
    size = " x ".join(f"{1e3 * it:g}" for it in (beam.length_m, beam.width_m, beam.thickness_m))
    share = f"{record['share']:.0%} of the motion"
    yield f"Surface     beam of {size} mm, {' / '.join(beam.supports)}"
    yield f"            mode {rig.mode} at {record['resonance_hz']:.0f} Hz, {share} there"
    yield (
        f"            bodies {1e3 * rig.body_height_m:g} mm high, friction at rest "
        f"{rig.structure.friction_coefficient:g}, damping ratio {rig.damping_ratio:g}"
    )


def _stated(study: Study) -> str:
    """Return of which conditions the last touch states its friction."""
    lacking = [item.name for item in study.condition if item.touches[-1].friction is None]
    if len(lacking) == len(study.condition):
        return "no touch states its friction: nothing is predicted"
    without = f", but in {listed(lacking)} it does not" * bool(lacking)
    return f"friction as touches state it{without}"


def _exclusion_lines(study: Study) -> Iterator[str]:
    """Yield what each rule of [exclusions] selects."""
    rules = selections(study.exclusions, asked=not study.absolute)
    if rules:
        yield ""
    for rule in rules:
        text = f"{rule['rule']} = {rule['limit']:g} {rule['selects']}"
        yield from wrap(text, 80, subsequent_indent="    ")


def _at_kept_resonance(folder: StudyFolder, study: Study, source: str) -> tuple[Study, Resonance]:
    """Return the study with the resonance of its calibration as the nominal one, where it counts.

    Raise `StudyError` if the study breaks a limit there, and `BadInput` for a damaged calibration.
    """
    # The default is known without the drivers, which take a while to import.
    if study.rig.dialect == "board":
        return study, "measured"
    from device.drivers.driver import driver_of

    if driver_of(study.rig.dialect).measures_vibration:
        return study, "measured"
    kept = kept_calibration(folder.path)
    if kept is None:
        return study, "missing"
    hz = kept.frequency_hz
    if problems := problems_at(study, hz):
        there = f"at the resonance of calibration.json, {hz:g} Hz"
        found = [replace(it, hint="; ".join(filter(None, (it.hint, there)))) for it in problems]
        raise StudyError(source, located(folder.text(), found))
    rig = study.rig.model_copy(update={"nominal_resonance_hz": hz})
    return study.model_copy(update={"rig": rig}), "kept"


def _require_in_table(study: Study, rig: Calibration, source: str, text: str) -> None:
    """Refuse touches of a measured surface that its table does not hold."""
    if study.surface.kind == "measured":
        from device.friction.surface_checks import table_problems

        if beyond := list(table_problems(study, rig.surface)):
            raise StudyError(source, located(text, beyond))


def _tracks(study: Study, rig: Calibration, source: str, text: str) -> "list[ShownTrack]":
    if not study.track:  # most studies have none, and should not wait for what shows them
        return []
    from runner.study.tracks import shown_tracks

    shown, unreachable = shown_tracks(study, rig)
    if unreachable:
        raise StudyError(source, located(text, unreachable))
    return shown


def _lock_lines(folder: StudyFolder, registered: "Registration | None", text: str) -> Iterator[str]:
    if registered is not None:
        yield f"Registered: {registered.digest}, which seeds the orders."
        if (digest := text_digest(text)) == registered.study_sha256:
            return
        if _is_accepted(folder, digest):
            yield "study.toml was amended after the registration."
            return
        yield "study.toml is not the registered one: restore it. Otherwise, before the first"
        yield "session, move registration.toml away and register anew; later, touchbeam amend"
        yield "accepts the change."


def _is_accepted(folder: StudyFolder, digest: str) -> bool:
    if not folder.journal.is_file():  # of a copy that rehearses
        return False
    from runner.journal.amendments import accepted_digests
    from runner.journal.opening import read_journal

    with read_journal(folder.journal) as journal:
        return digest in accepted_digests(journal)[-1:]


def _refused(
    source: str, problems: Sequence[Problem], *, as_json: bool
) -> tuple[list[str], list[str]]:
    lines = [problem.located(source) for problem in problems]
    if not as_json:
        return [], lines
    names = ("where", "rule", "value", "hint", "line")
    records = [
        {name: getattr(problem, name) for name in names}
        | ({"file": problem.file} if problem.file else {})
        for problem in problems
    ]
    return [_json({"ok": False, "problems": records, "participants": []})], lines


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)


def _contrast_of(study: Study, rig: Calibration) -> Contrast:
    """Return the friction model's predictions for touches; None where it has none."""
    # One thread is enough for a few places; starting a thread pool takes longer than the work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from device.friction.changes import predicted_contrast, trial_change

    @cache  # the trials of a cohort share few combinations, which alone determine a prediction
    def contrast(
        question: Question | None, expected: str | None, touches: tuple[Touch, ...]
    ) -> float | None:
        change = trial_change(study, question, expected, touches)
        value = predicted_contrast(change, rig=rig)
        return None if isnan(value) else value

    return contrast


def _prediction(study: Study, contrast: Contrast, rig: Calibration) -> Prediction:
    from device.friction.changes import LAW, RUNG, stated_friction

    def of_trial(trial: Trial) -> float | None:
        if trial.question is None and not trial.rated:
            return None
        return contrast(trial.question, trial.expected, trial.touches)

    source = {
        "measured": f"friction from the table {study.surface.table}",
        "given": "friction as touches state it, none where they do not",
    }.get(study.surface.kind, "")
    fitted = str(rig) if rig.origin and not source else ""
    told = Prediction(law=LAW, rung=RUNG, contrast=of_trial, rig=fitted, source=source)
    if study.surface.kind == "given" and not stated_friction(study).at_rest:
        return replace(told, rest="the mean of what touches state")
    return told
