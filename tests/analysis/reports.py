"""Reports for the tests, made from scores alone or from sessions that were really planned."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from typing import Any

import numpy as np

from analysis.loading.study_data import StudyData, load_study_data
from analysis.report.findings import Origin
from analysis.report.report import Report, report
from analysis.sensitivity.answers_model import Sensitivity
from protocol.journal.events import (
    Answered,
    DeviceArmed,
    DeviceOff,
    Event,
    ResonanceMeasured,
    SessionCompleted,
    StoredEvent,
    TouchEnded,
    TouchStarted,
    TrialStarted,
)
from protocol.journal.records import (
    CommandedDrive,
    Compliance,
    PlannedTrial,
    ReadBack,
    TraceSample,
)
from protocol.plan.plan import plan
from protocol.plan.trials import planned_trial
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.analysis.chains import answer, chain, opened, published_chain

ORIGIN = Origin(command="touchbeam report study", study_sha256="1" * 64)
PAPER = parsed_study(template("paper"))
EXTENDED = parsed_study(template("extended"))
RESONANCE_HZ = 24_000.0
SCORES = [[5, 7, 9], [4, 8, 9], [6, 6, 10], [5, 9, 8]]
NAMES = ("voltage", "structure", "pressure")


def imported(scores: object, *, names: Sequence[str] = NAMES, who: str = "P0") -> StudyData:
    """Scores as from a published table."""
    chains = [
        published_chain(
            f"{who}{row}",
            {
                name: None if np.isnan(score) else float(score)
                for name, score in zip(names, given, strict=True)
            },
        )
        for row, given in enumerate(np.array(scores, dtype=float))
    ]
    return load_study_data(chains, rehearsals=False)


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
    gain: float = 1.2,
    rate: Callable[[PlannedTrial], Answered] | None = None,
) -> list[Event]:
    """The events of one session in which a virtual person answered every planned trial.

    `gain` is what a level of the drive adds to the person's scores; `rate` makes the answers where
    no question is asked.
    """
    trials = [planned_trial(trial) for trial in plan(study, slot).trials]
    name = who or f"P{slot + 1:02d}"
    events: list[Event] = [
        opened(name, study.conditions, trials, kind=kind, slot=slot),
        DeviceArmed.from_json({"idn": "test"}),
        ResonanceMeasured(frequency_hz=RESONANCE_HZ, tip_m_per_v=9e-9),
    ]
    level = rng.normal(6.5, 1.0)
    for trial in trials:
        events.append(TrialStarted(index=trial.index, kind=trial.kind))
        for number, touch in enumerate(trial.touches):
            events += touched(number, touch, study, rng, measured=measured)
        events.append(rate(trial) if rate else _answer(trial, level, gain, rng))
    return [*events, DeviceOff(confirmed=True, why="the session is over"), SessionCompleted()]


def touched(
    number: int,
    touch: Mapping[str, Any],
    study: Study,
    rng: np.random.Generator,
    *,
    measured: bool,
) -> list[Event]:
    force_n = float(round(study.touch.force_n * touch["press"] * rng.normal(1.0, 0.05), 4))
    place_m = float(study.touch.smooth_place_m + rng.normal(0.0, 2e-4))
    frequency_hz = touch["frequency"] * RESONANCE_HZ
    start_v, end_v = touch["voltage_v"], touch.get("ramp_to_v", touch["voltage_v"])
    commanded = CommandedDrive(
        voltage_v=start_v, frequency_hz=frequency_hz, ramp_v_per_s=study.rig.ramp_v_per_s
    )
    judged = Compliance(force_n=force_n if measured else None, force_ok=None, place_ok=None)
    return [
        TouchStarted(touch=number, commanded=commanded, instruction=None),
        TouchEnded(
            touch=number,
            read_back=tuple(
                ReadBack.from_json(
                    {"output": True, "voltage_v": voltage_v, "frequency_hz": frequency_hz}
                )
                for voltage_v in (start_v, end_v)
            ),
            trace=tuple(TraceSample(0.1 * step, force_n, place_m) for step in range(8 * measured)),
            judged=judged,
        ),
    ]


_ANOTHER = {
    "smoother": "same",
    "rougher": "same",
    "stronger": "same",
    "weaker": "same",
    "swapped": "not swapped",
    "not swapped": "swapped",
}


def _answer(trial: PlannedTrial, level: float, gain: float, rng: np.random.Generator) -> Answered:
    change = None
    if trial.question is not None and trial.expected is not None:
        wrong = {**_ANOTHER, "same": "stronger" if trial.question == "strength" else "smoother"}
        change = trial.expected if rng.random() < 0.85 else wrong[trial.expected]
    score = round(float(np.clip(level + gain * trial.level + rng.normal(0, 1), 0, 10)))
    given = trial.scored and change is not None and change == trial.expected
    return answer(
        trial,
        score if given else None,
        change=change,
        reaction_time_s=round(float(rng.uniform(0.4, 2.0)), 3),
    )


def cohort(study: Study, participants: int, *, seed: int = 1) -> list[list[StoredEvent]]:
    """The sessions of a cohort."""
    rng = np.random.default_rng(seed)
    return [chain(session_events(study, slot, rng)) for slot in range(participants)]


@cache
def study_report() -> Report:
    """A report of sessions of the extended study, with catch and opposite trials."""
    found = load_study_data(cohort(EXTENDED, 4), rehearsals=False, rules=EXTENDED.exclusions)
    return report("a study", found, EXTENDED, ORIGIN)


def with_sensitivity(found: Report, known: Sensitivity) -> Report:
    """The report with another outcome of the model of the answers."""
    other = replace(found)
    vars(other)["sensitivity"] = known
    return other


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
