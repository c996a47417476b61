"""The text of a registration to paste into a registry, under the headings that registries use."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

from protocol.errors import listed
from protocol.registration.registration import Registration
from protocol.study.rules import Order, hours_in_words
from protocol.study.study import Study
from protocol.study.study_question import When
from protocol.study.touch import Touch
from protocol.study.track import Track

_ORDERS: dict[Order, str] = {
    "williams": "Each participant follows a sequence of a Williams design, which balances "
    "first-order carry-over over the cohort.",
    "blocks": "Each block is a random order of all conditions.",
    "random": "All trials of a participant come in random order.",
    "fixed": "All participants have the conditions in the same order.",
}

_TIMES: dict[When, str] = {
    "desk": "of the operator",
    "before": "before the first trial",
    "trial": "after trials",
    "block": "after each block",
    "after": "after the last trial",
}


def registry_text(study: Study, registered: Registration, tests: Mapping[str, str]) -> str:
    """Return the text, in plain English; `tests` says of each hypothesis how it is tested."""
    blind, sessions = study.session.blind_operator, registered.sessions
    seen = f"The operator sees {'neither condition nor' if blind else 'condition and'}"
    parts: dict[str, Iterable[str]] = {
        "Title": [study.publication.title or registered.study],
        # What the study file does not say is left to its author and never invented.
        "Authors": [listed(study.publication.authors) or "(to be filled in)"],
        "Hypotheses": [
            f"{'Primary' if name == registered.primary else 'Secondary'}: {name}. "
            f"Test: {tests[name]}."
            for name in registered.hypotheses
        ],
        "Study type": _study_type(study),
        "Blinding": [
            "Participants are not told what the device does in a trial or what is expected. "
            f"{seen} drive during a session."
        ],
        "Study design": _design(study),
        "Randomization": [
            "Orders, levels, catch and practice trials are drawn from random streams that are "
            "seeded by the digest of this registration. The data therefore prove that the plan "
            "came first.",
            f"Seed: the digest {registered.digest}.",
            f"The seed {study.study.seed} of the study file is not used.",
        ],
        # True by itself: `register` refuses a study that has had a session.
        "Existing data": ["Registration took place before the first session with a participant."],
        "Sample size and stopping rule": [
            f"Data collection ends when {registered.participants} participants have completed "
            f"{sessions} session{'s' * (sessions != 1)} each. A participant who drops out is "
            "replaced."
        ],
        "Sample size rationale": _power(registered),
        "Manipulated variables": _conditions(study),
        "Measured variables": _measured(study),
        "Statistical models and predictions": _prediction(registered),
        "Inference criteria": [
            f"The primary hypothesis is '{registered.primary}'.",
            *["Secondary hypotheses count as supported only if the primary one is."]
            * bool(registered.secondary),
        ],
        "Data exclusion": registered.exclusions or ["No data are excluded."],
        "Missing data": ["A score that is not given is missing, not zero; nobody is dropped."],
        "Digests": [
            f"Registration: {registered.digest}",
            f"Study file: {registered.study_sha256}",
            f"Analysis settings: {registered.analysis_sha256}",
            f"Software: touchbeam {registered.touchbeam}",
        ],
    }
    return "\n".join("\n  ".join([heading, *lines]) + "\n" for heading, lines in parts.items())


def _study_type(study: Study) -> Iterator[str]:
    yield f"Experiment, within participants{' and between groups' * bool(study.group)}."
    if study.group:
        how = study.design.assign_groups.replace("answer", "answer to the operator")
        groups = "; ".join(
            f"{it.name}, {it.size} participants{f' ({it.when})' * (it.when is not None)}"
            for it in study.group
        )
        yield f"Groups: {groups}. They are assigned {how}."


def _design(study: Study) -> Iterator[str]:
    design = study.design
    sessions = f"{design.sessions} session{'s' * (design.sessions != 1)} per participant"
    if design.hours_between:
        sessions += f", {hours_in_words(*design.hours_between)} between them"
    sessions += "."
    if study.condition:
        yield (
            f"{len(study.condition)} conditions, {design.repeats} trial"
            f"{'s' * (design.repeats != 1)} of each per session, {sessions}"
        )
        yield _ORDERS[design.order]
    if study.track:
        order = f"s, {design.tracks}" * (len(study.track) > 1)
        yield f"Thresholds by {len(study.track)} track{order}, {sessions}"
    if design.catch_trials:
        yield f"{design.catch_trials} catch trials (0 V) per session."
    if design.opposite_repeats:
        yield f"{design.opposite_repeats} of the repeats run in the opposite order."


def _power(registered: Registration) -> Sequence[str]:
    """Return the answer of the power analysis, and each of its other results with its name."""
    others = [f"{name}: {text}" for name, text in registered.power.items() if name != "answer"]
    answer = registered.power.get("answer", "" if others else "(to be filled in)")
    return [*filter(None, [answer]), *(["Each test by its own p:"] if others else []), *others]


def _conditions(study: Study) -> Iterator[str]:
    yield (
        "Amplitudes are peak; a frequency without a unit is relative to the resonance, which is "
        "measured in each session."
    )
    for condition in study.condition:
        touches = "; then ".join(map(_touch, condition.touches))
        factors = ", ".join(f"{level:g}" for level in condition.levels)
        levels = f" All amplitudes times {factors}, in random order." if factors != "1" else ""
        yield (
            f"{condition.name}: {touches}.{levels} Question about {condition.question}, "
            f"expected answer: {condition.expected}."
        )
    yield from chain.from_iterable(map(_track, study.track))


def _track(track: Track) -> Iterator[str]:
    """Yield what a track asks, at which levels, by which rule, and what its threshold is."""
    values, by = track.values, {"reversals": "", "interval_db": " dB wide"}
    yield (
        f"{track.name}: {track.task}, {track.method}, {track.trials} trials, {track.catch} catch "
        f"and {track.easy} easy ones; which is {track.found}; {len(values)} levels of "
        f"{track.axis}, {', '.join(f'{value:.6g}' for value in values)}."
    )
    made = _touch(track.comparison).removesuffix(", 0 V")  # the axis gives its voltage
    yield f"Comparison: {made}, with the {track.axis} of the level."
    if track.standard:
        yield f"Standard: {_touch(track.standard)}."
    if track.method == "staircase":
        up, down = track.up_step_db or track.up_step_levels, track.step_db or track.step_levels
        unit = "dB" if track.step_db else "levels"
        steps = ", ".join(f"{step:g}" for step in down)
        weighted = f", up {', '.join(f'{step:g}' for step in up)}" if up else ""
        yield f"Rule: {track.rule}, {track.streak}, steps {steps}{weighted} {unit}."
    if track.stop:
        said = {key: value for key, value in track.stop if value is not None}
        ends = [f"{key.split('_')[0]} {value:g}{by[key]}" for key, value in said.items()]
        yield f"It ends sooner at: {', '.join(ends)}."
    yield (
        f"Its threshold: {track.share:.4g} {'yes' if track.task == 'yes or no' else 'correct'}, "
        f"curve {track.shape}, lapse rate {track.lapse[0]:g} to {track.lapse[1]:g}."
    )


def _touch(touch: Touch) -> str:
    """Return what the finger and the device do: `slide to the left, 100 V, frequency 1`."""
    at_place, sliding = "touch the place", f"slide to the {touch.direction}"
    frequency = f"frequency {_course(*touch.drive_ends)}"
    parts = (
        at_place if touch.place == "smooth" else sliding,
        "several fingers" if touch.coverage == "full" else "",
        f"{touch.press:g} times the force" if touch.press != 1 else "",
        f"beam {touch.beam}" if touch.beam else "",
        f"{_course(f'{touch.voltage_v:g}', f'{touch.end_voltage_v:g}')} V",
        # At 0 V there is no drive that could have a frequency.
        frequency if touch.peak_voltage_v else "",
        f"{touch.duration_s:g} s" if touch.duration_s else "",
        f"{touch.sliding_speed_m_s:g} m/s" if touch.sliding_speed_m_s else "",
    )
    return ", ".join(filter(None, parts))


def _course(start: str, end: str) -> str:
    return start if start == end else f"{start} to {end}"


def _measured(study: Study) -> Iterator[str]:
    rating = study.rating
    when = {
        "agrees": "if the answer agrees with the expectation",
        "noticed": "if the answer says that anything changed",
        "always": "always",
    }[rating.score_when]
    if study.condition:
        yield (
            f"The reported change, and the strength of the effect from {rating.minimum} to "
            f"{rating.maximum}, asked {when}."
        )
    if study.track:
        yield "Of each track: the answer, the level, and the threshold that the answers tell."
    for question in study.question:
        of = f" of {listed(question.conditions)}" if question.conditions else ""
        # Registries are read in English; a study without it is quoted in its own language.
        text = question.text.get("en") or next(iter(question.text.values()))
        only = f", if {question.asked_if}" * (question.asked_if is not None)
        yield f"{question.name} ({question.kind}, {_TIMES[question.when]}{of}{only}): {text}"


def _prediction(registered: Registration) -> Iterator[str]:
    rig = registered.calibration.get("origin", "") or "the paper's values"
    yield (
        f"Friction is predicted by touchbeam {registered.touchbeam}, law {registered.law}, rung "
        f"{registered.rung}, calibration: {rig}."
    )
    for name, value in registered.analysis.items():
        yield f"{name}: {value}"
