"""A study that spoils what can be spoilt: quotes, tabs, formulas, Chinese; dropouts too."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cache

from protocol.journal.events import SessionOpened, StoredEvent
from protocol.journal.state import SessionState
from protocol.plan.plan import plan
from protocol.plan.trials import Trial
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from runner.session.session import Session, SessionKind

NOTES = (
    'said "no",\tthen\nleft',
    "=cmd()|' /C calc'!A1",
    "触觉 🖐 @home",
    "n/a",
    "bell \a, escape \x1b[31m, line \u2028 separator",
    "one\r\ntwo\rthree",
    "C:\\new\\table",
    "<script>alert(1)</script>",
    "＝SUM(A1)",
    " -1+1",
)

PUBLICATION = """
[publication]
title = "Touch, \\"felt\\" 触觉"
authors = ["Surname, Given", "姓名"]
licence = "CC0"
institution = "An institute"
institution_address = "A street"
ethics_approvals = ["Committee 1"]
funding = ["Grant 1"]
references = ["https://example.org/paper"]
doi = "10.5072/example"
keywords = ["touch"]
"""

NAMES = {
    "frequency": '=cmd()|"频率"',
    "structure": "structure, 'dense'\t;",
    "voltage": "<script>alert(1)</script>",
}
"""What the nasty study calls three of the paper's conditions."""


def study_text(*, publication: str = PUBLICATION) -> str:
    """The paper's study with names that mean something to a spreadsheet, a page or a shell."""
    text = template("paper").replace('name = "paper"', 'name = "touch \\"触觉\\" 🖐 1"')
    text = text.replace('"1.5 mm"', '"1;5 mm"')
    for name, nasty in NAMES.items():
        text = text.replace(f'name = "{name}"', f"name = {json.dumps(nasty, ensure_ascii=False)}")
    return text + publication


@dataclass
class Written:
    """The events of one session as they are appended; the clock ticks with each."""

    participant: str
    number: int = 1
    kind: SessionKind = "participant"
    text: str = field(default_factory=study_text)
    events: list[StoredEvent] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.study: Study = parsed_study(self.text)
        self.plan = plan(self.study, slot=0)
        self._state = SessionState()
        session = Session(
            participant=self.participant,
            number=self.number,
            kind=self.kind,
            study=self.study,
            study_text=self.text,
            plan=self.plan,
        )
        self.add("session-opened", **session.recorded_as(SessionOpened).to_json())

    def add(self, tag: str, **payload: object) -> None:
        """Append an event; what the session's state does not allow is an error here too."""
        seq = len(self.events)
        self.events.append(
            StoredEvent(
                seq=seq,
                tag=tag,
                utc=datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=seq),
                monotonic_s=float(seq),
                payload=payload,
            )
        )
        self._state.take(self.events[-1])

    def arm(self) -> None:
        """Arm the device and measure the resonance."""
        self.add("device-armed", idn='rig, the "first"', boot=1, device_time_s=0.0)
        noted = {"skin state": "dry,\tclean", "room temperature": "=20+1"}
        self.add("rig-described", answers=noted)
        self.add("beam-mounted", beam="1;5 mm")
        self.add("resonance-measured", frequency_hz=24_000.0, tip_m_per_v=1e-8)

    def start(self, trial: Trial) -> None:
        """Begin a trial and make its touches."""
        self.add("trial-started", index=trial.index, kind=trial.kind)
        for number in range(len(trial.touches)):
            self.touch(number)

    def touch(self, number: int) -> None:
        drive = {"voltage_v": 100.0, "frequency_hz": 24_000.0}
        self.add("touch-started", touch=number, commanded={**drive, "ramp_v_per_s": 400.0})
        read = {**drive, "output": True, "monitor_v": -0.5}
        judged = {"force_n": 0.5, "force_ok": True, "place_ok": None}
        self.add("touch-ended", touch=number, read_back=[read, read], trace=[], judged=judged)

    def answer(self, trial: Trial, score: int | None) -> None:
        """Answer as expected with `score`, or, if it is None, against the expectation."""
        against = "not swapped" if trial.question == "places" else "same"
        change = trial.expected if score is not None else against if trial.expected else None
        self.add(
            "answered",
            index=trial.index,
            kind=trial.kind,
            condition=trial.condition,
            change=change,
            agrees=None if change is None else change == trial.expected,
            score=score if trial.scored else None,
            level=trial.level,
            opposite=trial.opposite,
            reaction_time_s=[0.5, 1.25] if trial.scored and score is not None else [0.5],
            judged=[],
        )

    def abort(self, trial: Trial, why: str) -> None:
        self.add("trial-aborted", index=trial.index, why=why)

    def whole(self, scores: Mapping[str, int | None], notes: tuple[str, ...] = ()) -> None:
        """Go through all trials; a condition that is not in `scores` is scored 7."""
        self.arm()
        for trial in self.plan.trials:
            self.start(trial)
            self.answer(trial, scores.get(str(trial.condition), 7))
            for note in notes[trial.index :: len(self.plan.trials)]:
                self.add("note", text=note)
        self.finish()

    def finish(self) -> None:
        self.add("device-off", confirmed=True, why="end of session")
        self.add("session-completed")


@cache
def sessions(text: str) -> list[Written]:
    """Every kind of session there is, under the study `text`."""
    names = parsed_study(text).conditions

    def new(participant: str, number: int = 1, kind: SessionKind = "participant") -> Written:
        return Written(participant, number, kind, text)

    first, second, again = new("P-01"), new("P01"), new("P01", 2)
    first.whole({names[0]: 10, names[1]: 0}, NOTES)
    second.whole({names[0]: None, names[1]: 3})
    second.add("trial-excluded", index=3, reason='a "noise",\tthen =1+1')
    again.whole({names[2]: 1})
    repeated, dropped_out = _repeated(new("p_01")), _dropped_out(new("D01"))
    left = new("D02")  # before the first trial
    withdrawn, excluded, rehearsal = new("W01"), new("E01"), new("R01", kind="rehearsal")
    for played in (withdrawn, excluded, rehearsal):
        played.whole({})
    withdrawn.add("withdrawn")
    excluded.add("session-excluded", reason="fell asleep")
    return [first, second, again, repeated, dropped_out, left, withdrawn, excluded, rehearsal]


def _repeated(session: Written) -> Written:
    """A trial that needed two attempts; nobody gave a single score."""
    session.arm()
    for trial in session.plan.trials:
        session.start(trial)
        if trial.index == 2:
            session.abort(trial, "repeated at the operator's wish")
            session.start(trial)
        session.answer(trial, None)
    session.finish()
    return session


def _dropped_out(session: Written) -> Written:
    """Left in the middle of a touch; the process ended with the session."""
    session.arm()
    first, second = session.plan.trials[:2]
    session.start(first)
    session.answer(first, None)
    session.add("trial-started", index=second.index, kind=second.kind)
    drive = {"voltage_v": 100.0, "frequency_hz": 24_000.0, "ramp_v_per_s": 400.0}
    session.add("touch-started", touch=0, commanded=drive)
    return session
