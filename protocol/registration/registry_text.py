"""A registration in plain words, to paste into a registry."""

from collections.abc import Iterator, Mapping

from protocol.registration.registration import Registration
from protocol.study.surface import Surface


def registry_text(
    registered: Registration, tests: Mapping[str, str], surface: Surface
) -> Iterator[str]:
    """Yield the text line by line; `tests` says of each hypothesis how it is tested.

    Of a hypothesis that the study file no longer has no test is known.
    """
    yield f"Study: {registered.study}"
    for name in registered.hypotheses:
        rank = "Primary" if name == registered.primary else "Secondary"
        yield f"{rank} hypothesis: {name}" + (f" ({tests[name]})" if name in tests else "")
    if registered.secondary:
        yield "Secondary hypotheses count as supported only if the primary one is."
    groups = ", ".join(f"{size} {name}" for name, size in registered.groups.items())
    yield f"Participants: {registered.participants}" + (f" ({groups})" if groups else "")
    yield f"Sessions of each: {registered.sessions}"
    for rule in registered.exclusions:
        yield f"Exclusion: {rule}"
    yield f"Prediction: {_prediction(registered, surface)}"
    yield f"Study file: SHA-256 {registered.study_sha256}"
    settings = registered.analysis_sha256
    yield f"Analysis: touchbeam {registered.touchbeam}, settings with SHA-256 {settings}"
    yield f"Registration, which seeds the orders: SHA-256 {registered.digest}"


def _prediction(registered: Registration, surface: Surface) -> str:
    if surface.kind == "measured":
        return f"from the table {surface.table}, which the study file's SHA-256 includes"
    if surface.kind == "given":
        return "from the friction that touches state; none where they do not"
    own = "the study file's" if surface.is_own_beam else "the paper's"
    rig = registered.calibration.get("origin", "") or f"{own} values"
    return f"law {registered.law}, rung {registered.rung}, calibration: {rig}"
