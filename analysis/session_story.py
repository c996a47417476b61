"""One session as the analysis sees it: its trials, and what else happened in it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from analysis.answered_trials import Happened, TrialRow, answered_trials


@dataclass(frozen=True, kw_only=True)
class Incident:
    """Something that interrupted a session or that the operator noted."""

    participant: str
    session: int
    what: str
    text: str = ""
    trial: int | None = None


@dataclass(frozen=True, kw_only=True)
class SessionStory:
    """What is known of one session that was neither excluded nor withdrawn.

    `excluded_trials` maps the index of a trial to the reason for taking it out.
    """

    participant: str
    number: int
    kind: str
    conditions: tuple[str, ...]
    rows: tuple[TrialRow, ...]
    finished: bool
    excluded_trials: Mapping[int, str]
    incidents: tuple[Incident, ...]
    opened: Mapping[str, Any]

    @property
    def kept(self) -> tuple[TrialRow, ...]:
        """The trials that were not excluded."""
        return tuple(row for row in self.rows if row.index not in self.excluded_trials)


def session_story(events: Sequence[Happened]) -> SessionStory:
    """Return what the events of one session say; the first one opens or imports it."""
    tag, opened = events[0]
    published = tag == "scores-imported"
    return SessionStory(
        participant=opened["participant"],
        number=opened.get("session", 1),
        kind="published" if published else opened["kind"],
        conditions=tuple(opened["conditions"]),
        rows=tuple(answered_trials(events)),
        finished=published or any(tag == "session-completed" for tag, _ in events),
        excluded_trials={
            payload["index"]: payload.get("reason", "")
            for tag, payload in events
            if tag == "trial-excluded"
        },
        incidents=tuple(_incidents(opened, events)),
        # The plan and the study are long and have been read.
        opened={
            name: value for name, value in opened.items() if name not in {"trials", "study_text"}
        },
    )


def _incidents(opened: Mapping[str, Any], events: Sequence[Happened]) -> list[Incident]:
    found = []
    for tag, payload in events:
        said = _in_words(tag, payload)
        if said is not None:
            found.append(
                Incident(
                    participant=opened["participant"],
                    session=opened.get("session", 1),
                    what=said[0],
                    text=said[1],
                    trial=payload.get("index"),
                )
            )
    return found


def _in_words(tag: str, payload: Mapping[str, Any]) -> tuple[str, str] | None:
    """What a reader of the report is told of an event, None for what is no incident."""
    if tag == "device-off" and payload.get("confirmed") is not False:
        return None
    if tag == "rig-described":
        answers = payload.get("answers", {})
        return "rig", "; ".join(f"{name}: {said}" for name, said in answers.items())
    what = _INCIDENTS.get(tag)
    if what is None:
        return None
    return what, str(payload.get("text") or payload.get("why") or "")


_INCIDENTS = {
    "session-resumed": "resumed",
    "practice-renewed": "practised again",
    "paused": "paused",
    "trial-aborted": "trial aborted",
    "note": "note",
    "device-off": "device off, not confirmed",
}
