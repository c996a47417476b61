"""The text of a registration to paste into a registry, under the headings that registries use."""

from collections.abc import Iterable, Iterator, Sequence

from protocol.registration.hypotheses import hypotheses
from protocol.registration.registration import Registration
from protocol.study.design import Order
from protocol.study.study import Study

_ORDERS: dict[Order, str] = {
    "williams": "Each participant follows a sequence of a Williams design, which balances "
    "first-order carry-over over the cohort.",
    "blocks": "Each block is a random order of all conditions.",
    "random": "All trials of a participant come in random order.",
    "fixed": "All participants have the conditions in the same order.",
}


def registry_text(study: Study, registered: Registration) -> str:
    """Return the text, in plain English."""
    parts = [
        ("Title", [study.publication.title or registered.study]),
        ("Authors", [", ".join(study.publication.authors) or "(to be filled in)"]),
        ("Hypotheses", _hypotheses(study, registered)),
        ("Study type", ["Experiment, within participants."]),
        ("Blinding", [_blinding(study)]),
        ("Study design", _design(study)),
        ("Randomization", _randomisation(study, registered)),
        ("Existing data", ["Registration took place before the first session with a participant."]),
        ("Sample size and stopping rule", _stopping(registered)),
        ("Sample size rationale", registered.power.values() or ["(to be filled in)"]),
        ("Manipulated variables", _conditions(study)),
        ("Measured variables", [_measured(study)]),
        ("Statistical models and predictions", _prediction(registered)),
        ("Inference criteria", _inference(registered)),
        ("Data exclusion", registered.exclusions or ["No data are excluded."]),
        ("Missing data", ["A score that is not given is missing, not zero; nobody is dropped."]),
        ("Digests", _digests(registered)),
    ]
    return "\n".join(f"{heading}\n{_indented(lines)}" for heading, lines in parts)


def _indented(lines: Iterable[str]) -> str:
    return "".join(f"  {line}\n" for line in lines)


def _hypotheses(study: Study, registered: Registration) -> Iterator[str]:
    tests = hypotheses(study.conditions)
    for name in registered.hypotheses:
        rank = "Primary" if name == registered.primary else "Secondary"
        yield f"{rank}: {name}. Test: {tests[name]}."


def _blinding(study: Study) -> str:
    hidden = "The operator sees neither" if study.session.blind_operator else "The operator sees"
    joined = "nor" if study.session.blind_operator else "and"
    return (
        "Participants are not told what the device does in a trial or what is expected. "
        f"{hidden} condition {joined} drive during a session."
    )


def _design(study: Study) -> Iterator[str]:
    design = study.design
    yield (
        f"{len(study.condition)} conditions, {design.repeats} trial"
        f"{'s' * (design.repeats != 1)} of each per session, {design.sessions} session"
        f"{'s' * (design.sessions != 1)} per participant."
    )
    yield _ORDERS[design.order]
    if design.catch_trials:
        yield f"{design.catch_trials} catch trials (0 V) per session."
    if design.opposite_repeats:
        yield f"{design.opposite_repeats} of the repeats run in the opposite order."


def _randomisation(study: Study, registered: Registration) -> Sequence[str]:
    return [
        "Orders, levels, catch and practice trials are drawn from random streams that are seeded "
        "by the digest of this registration. The data therefore prove that the plan came first.",
        f"Seed: the digest {registered.digest}.",
        f"The seed {study.study.seed} of the study file is not used.",
    ]


def _stopping(registered: Registration) -> Sequence[str]:
    return [
        f"Data collection ends when {registered.participants} participants have completed "
        f"{registered.sessions} session{'s' * (registered.sessions != 1)} each. A participant who "
        "drops out is replaced."
    ]


def _conditions(study: Study) -> Iterator[str]:
    for condition in study.condition:
        levels = ", ".join(f"{level:g}" for level in condition.levels)
        yield (
            f"{condition.name}: {len(condition.touches)} touch"
            f"{'es' * (len(condition.touches) != 1)}, levels {levels}; question about "
            f"{condition.question}, expected answer: {condition.expected}."
        )


def _measured(study: Study) -> str:
    rating = study.rating
    when = (
        "if the answer agrees with the expectation" if rating.score_when == "agrees" else "always"
    )
    return (
        f"The reported change, and the strength of the effect from {rating.minimum} to "
        f"{rating.maximum}, asked {when}."
    )


def _prediction(registered: Registration) -> Iterator[str]:
    rig = registered.calibration.get("origin", "") or "the paper's values"
    yield (
        f"Friction is predicted by touchbeam {registered.touchbeam}, law {registered.law}, rung "
        f"{registered.rung}, calibration: {rig}."
    )
    for name, value in registered.analysis.items():
        yield f"{name}: {value}"


def _inference(registered: Registration) -> Iterator[str]:
    yield f"The primary hypothesis is '{registered.primary}'."
    if registered.secondary:
        yield "Secondary hypotheses count as supported only if the primary one is."


def _digests(registered: Registration) -> Sequence[str]:
    return [
        f"Registration: {registered.digest}",
        f"Study file: {registered.study_sha256}",
        f"Analysis settings: {registered.analysis_sha256}",
        f"Software: touchbeam {registered.touchbeam}",
    ]
