"""Reports for the tests, made from scores alone or from sessions that were really planned."""

from collections.abc import Sequence
from functools import cache
from html.parser import HTMLParser
from typing import Any

import numpy as np

from analysis.loading.sessions import Happened
from analysis.loading.study_data import StudyData, load_study_data
from analysis.report.findings import Origin
from analysis.report.report import Report, report
from protocol.plan.plan import plan
from protocol.plan.trials import Trial
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template

ORIGIN = Origin(command="touchbeam report study", study_sha256="1" * 64)
PAPER = parsed_study(template("paper"))
EXTENDED = parsed_study(template("extended"))
SCORES = [[5, 7, 9], [4, 8, 9], [6, 6, 10], [5, 9, 8]]
NAMES = ("voltage", "structure", "pressure")


def imported(scores: object, *, names: Sequence[str] = NAMES, who: str = "P0") -> StudyData:
    """Scores as from a published table."""
    sessions: list[list[Happened]] = [
        [
            (
                "scores-imported",
                {
                    "participant": f"{who}{row}",
                    "conditions": list(names),
                    "scores": {
                        name: None if np.isnan(score) else score
                        for name, score in zip(names, given, strict=True)
                    },
                    "source": "scores.csv",
                    "source_sha256": "2" * 64,
                },
            )
        ]
        for row, given in enumerate(np.array(scores, dtype=float))
    ]
    return load_study_data(sessions, rehearsals=False)


def made(scores: object = SCORES, *, names: Sequence[str] = NAMES, who: str = "P0") -> Report:
    """A report of published scores."""
    return report("a study", imported(scores, names=names, who=who), PAPER, ORIGIN)


@cache
def plain_report() -> Report:
    """A report of four subjects' complete scores."""
    return made()


def session_events(
    study: Study,
    slot: int,
    rng: np.random.Generator,
    *,
    kind: str = "participant",
    who: str = "",
    measured: bool = True,
) -> list[Happened]:
    """The events of one session in which a virtual person answered every planned trial."""
    planned = plan(study, slot)
    touches = [trial_touches(trial) for trial in planned.trials]
    opened = {
        "participant": who or f"P{slot + 1:02d}",
        "session": 1,
        "kind": kind,
        "study_sha256": "1" * 64,
        "slot": slot,
        "conditions": list(study.conditions),
        "trials": [
            {
                "index": trial.index,
                "kind": trial.kind,
                "condition": trial.condition,
                "question": trial.question,
                "expected": trial.expected,
                "touches": made,
            }
            for trial, made in zip(planned.trials, touches, strict=True)
        ],
        "seed": 1,
        "versions": {"touchbeam": "0.1.0", "python": "3.11.7"},
    }
    events: list[Happened] = [
        ("session-opened", opened),
        ("device-armed", {"idn": "test"}),
        ("resonance-measured", {"frequency_hz": 24_000.0, "tip_m_per_v": 9e-9}),
    ]
    level = rng.normal(6.5, 1.0)
    for trial, made in zip(planned.trials, touches, strict=True):
        events.append(("trial-started", {"index": trial.index, "kind": trial.kind}))
        for number, touch in enumerate(made):
            events.append(("touch-started", {"touch": number}))
            events.append(("touch-ended", _done(number, touch, study, rng, measured=measured)))
        events.append(("answered", _answer(trial, level, rng)))
    off = {"confirmed": True, "why": "the session is over"}
    return [*events, ("device-off", off), ("session-completed", {})]


def trial_touches(trial: Trial) -> list[dict[str, Any]]:
    """The touches as the journal holds them."""
    return [touch.model_dump(exclude_none=True) for touch in trial.touches]


def _done(
    number: int, touch: dict[str, Any], study: Study, rng: np.random.Generator, *, measured: bool
) -> dict[str, Any]:
    force_n = float(round(study.touch.force_n * touch["press"] * rng.normal(1.0, 0.05), 4))
    place_m = float(study.touch.smooth_place_m + rng.normal(0.0, 2e-4))
    end_v = touch.get("ramp_to_v", touch["voltage_v"])
    drives = [(touch["voltage_v"], touch["frequency"]), (end_v, touch["frequency"])]
    return {
        "touch": number,
        "read_back": [
            {"voltage_v": voltage_v, "frequency_hz": frequency * 24_000.0}
            for voltage_v, frequency in drives
        ],
        "trace": [[0.1 * step, force_n, place_m] for step in range(8)] if measured else [],
        "judged": {"force_n": force_n if measured else None},
    }


_ANOTHER = {
    "smoother": "same",
    "rougher": "same",
    "stronger": "same",
    "weaker": "same",
    "swapped": "not swapped",
    "not swapped": "swapped",
}


def _answer(trial: Trial, level: float, rng: np.random.Generator) -> dict[str, Any]:
    change = None
    if trial.question is not None and trial.expected is not None:
        wrong = {**_ANOTHER, "same": "stronger" if trial.question == "strength" else "smoother"}
        change = trial.expected if rng.random() < 0.85 else wrong[trial.expected]
    agrees = None if change is None else change == trial.expected
    score = round(float(np.clip(level + 1.2 * trial.level + rng.normal(0, 1), 0, 10)))
    return {
        "index": trial.index,
        "kind": trial.kind,
        "condition": trial.condition,
        "change": change,
        "agrees": agrees,
        "score": score if trial.scored and agrees else None,
        "level": trial.level,
        "opposite": trial.opposite,
        "reaction_time_s": [round(float(rng.uniform(0.4, 2.0)), 3)],
    }


def cohort(study: Study, participants: int, *, seed: int = 1) -> list[list[Happened]]:
    """The sessions of a cohort."""
    rng = np.random.default_rng(seed)
    return [session_events(study, slot, rng) for slot in range(participants)]


@cache
def study_report() -> Report:
    """A report of sessions of the extended study, with catch and opposite trials."""
    found = load_study_data(cohort(EXTENDED, 4), rehearsals=False, rules=EXTENDED.exclusions)
    return report("a study", found, EXTENDED, ORIGIN)


class ReadPage(HTMLParser):
    """What a reader finds on a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data.strip())
