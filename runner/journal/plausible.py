"""What no session can have recorded although each value has its type: what contradicts its plan.

The hashes of a chain do not tell: who writes events can compute them. Whoever reads a session may
rely on what is looked at here.
"""

from collections.abc import Iterable, Iterator, Mapping

from protocol.journal import events as kinds
from protocol.journal.events import StoredEvent
from protocol.journal.records import PlannedTrial
from protocol.study.columns import TAKEN
from protocol.study.study_question import is_identifier

_LOOKED_AT = {
    kind.TAG
    for kind in (
        kinds.SessionOpened, kinds.SessionResumed, kinds.ResonanceMeasured, kinds.TrialStarted,
        kinds.TouchStarted, kinds.Answered, kinds.QuestionAnswered, kinds.TrialAborted,
        kinds.TrialDeferred, kinds.TrialExcluded, kinds.TrialIncluded, kinds.TrialsNotNeeded,
        kinds.PracticeRenewed,
    )
}  # fmt: skip
"""Long traces are not among them, and need not be parsed."""


def contradiction(events: Iterable[StoredEvent]) -> str:
    """Return which of a session's events, each of sound types, cannot have been, and why; or ''."""
    planned: dict[int, PlannedTrial] = {}
    running: PlannedTrial | None = None
    for stored in events:
        if stored.erased or stored.tag not in _LOOKED_AT:
            continue
        event = stored.record
        if isinstance(event, kinds.SessionTerms):
            planned |= {trial.index: trial for trial in event.trials}
        if wrong := next(_wrong(event, planned, running), ""):
            return f"event {stored.seq} is damaged: {stored.tag}, {wrong}"
        if isinstance(event, kinds.TrialStarted):
            running = planned.get(event.index)
    return ""


def _wrong(
    event: kinds.Event, planned: Mapping[int, PlannedTrial], running: PlannedTrial | None
) -> Iterator[str]:
    if planned and (missing := {*_indices(event)} - planned.keys()):
        yield f"the plan has no trial {min(missing)}"
        return
    if any(name in TAKEN or not is_identifier(name) for name in _questions(event)):
        yield "no question can have this name"
    match event:
        case kinds.ResonanceMeasured(frequency_hz=frequency_hz) if frequency_hz <= 0:
            yield "frequency_hz must be above 0"
        case kinds.TouchStarted(touch=touch) if running and not 0 <= touch < len(running.touches):
            yield f"its trial has no touch {touch}"
        case kinds.TrialStarted(index=index) | kinds.Answered(index=index) if planned:
            yield from _not_as_planned(event, planned[index])


def _not_as_planned(
    event: kinds.TrialStarted | kinds.Answered, trial: PlannedTrial
) -> Iterator[str]:
    if event.kind != trial.kind:
        yield "kind is not that of the plan"
    if isinstance(event, kinds.TrialStarted):
        return
    if event.condition != trial.condition:
        yield "condition is not that of the plan"
    one, other = (it and (it.name, it.role, it.interval) for it in (event.track, trial.track))
    if one != other:
        yield "track is not that of the plan"


def _indices(event: kinds.Event) -> Iterable[int]:
    match event:
        case kinds.TrialDeferred():
            return (event.index, event.after)
        case kinds.TrialsNotNeeded() | kinds.PracticeRenewed():
            return event.indices
        case (
            kinds.TrialStarted()
            | kinds.Answered()
            | kinds.TrialAborted()
            | kinds.TrialExcluded()
            | kinds.TrialIncluded()
        ):
            return (event.index,)
    return ()


def _questions(event: kinds.Event) -> Iterable[str]:
    match event:
        case kinds.QuestionAnswered(name=name):
            return (name,)
        case kinds.Answered(questions=given):
            return [answer.name for answer in given]
    return ()
