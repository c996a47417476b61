"""The proof that orders follow from a digest: each session's plan is drawn again and compared."""

from functools import lru_cache

from protocol.errors import BadInput
from protocol.journal.events import SLIDE, SessionOpened, SessionResumed
from protocol.journal.records import PlannedTrial
from protocol.plan.plan import plan
from protocol.plan.slide_plan import slide_plan, slide_study
from protocol.plan.trials import Plan, planned_trial
from protocol.registration.registration import locked
from protocol.study_file.loading import parsed_study, text_digest


def order_problem(opened: SessionOpened, under: SessionOpened | SessionResumed) -> str:
    """Return why the trials of a registered session are not those of its digest; '' if they are.

    The plan is drawn from the study file and the digest that the journal holds, so that a journal
    proves its orders by itself.

    Args:
        opened: the session's first event.
        under: the same, or a later one that resumes the session.
    """
    if under.registration is None or under.study_text is None:
        return ""
    if under.study_sha256 != text_digest(under.study_text):
        return "its study file does not have the digest that the journal names"
    slot = None if opened.participant == SLIDE else opened.slot
    try:
        drawn = _drawn(under.study_text, under.registration, slot, opened.session)
    except ValueError as error:  # a study file that this version refuses, or no digest
        return f"its order cannot be drawn again ({error})"
    if len(drawn.trials) != len(under.trials):
        return f"the digest gives {len(drawn.trials)} trials, the journal has {len(under.trials)}"
    for trial, recorded in zip(drawn.trials, under.trials, strict=True):
        if not _is_recorded(planned_trial(trial), recorded):
            return (
                f"its order does not follow from the registration: trial {recorded.index} is "
                f"{recorded.condition or recorded.kind}, the digest gives "
                f"{trial.condition or trial.kind}"
            )
    return ""


@lru_cache(maxsize=256)
def _drawn(study_text: str, digest: str, slot: int | None, session: int) -> Plan:
    """Return the plan of a slot, or of a sliding experiment, which has none."""
    try:
        study = locked(parsed_study(study_text), digest)
    except BadInput as error:
        raise ValueError(str(error)) from error
    return slide_plan(slide_study(study), session) if slot is None else plan(study, slot, session)


def _is_recorded(trial: PlannedTrial, recorded: PlannedTrial) -> bool:
    """Return whether a trial is the recorded one; keys that its build did not write are skipped."""
    drawn, kept = trial.to_json(), recorded.to_json()
    made, before = drawn.pop("touches"), kept.pop("touches")
    return (
        drawn == kept
        and len(made) == len(before)
        and all(
            {key: new.get(key) for key in old} == old for new, old in zip(made, before, strict=True)
        )
    )
