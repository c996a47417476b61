"""From options to a session that runs: who sits down, on which rig, at which pace."""

import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from protocol.errors import BadInput
from protocol.plan import plan
from protocol.texts import Language
from runner.clock import SteppedClock, WallClock
from runner.console import ConsoleOperator, ConsoleParticipant, TypedLines
from runner.journal import Journal, open_journal, session_name
from runner.loop import run
from runner.ports import Clock, Operator, Participant
from runner.rigging import SIMULATED, Rigged, rigged
from runner.session import Session, text_digest
from runner.session_log import SessionLog
from runner.session_state import SessionState
from runner.slots import slot
from runner.study_folder import StudyFolder, pseudonym
from runner.virtual import HandOperator, VirtualParticipant, drawn_character

Ratings = Literal["window", "console", "virtual"]
Pace = Literal["wall", "stepped"]


@dataclass(frozen=True, kw_only=True)
class Sitting:
    """Everything that was asked for on the command line."""

    folder: StudyFolder
    participant: str
    number: int = 1
    device: str | None = None
    ratings: Ratings = "window"
    pace: Pace | None = None
    rehearsal: bool = False
    language: Language = "en"
    consent: str | None = None
    seed: int | None = None
    touchbeam: Sequence[str] = ("touchbeam",)


def sit(sitting: Sitting, say: Callable[[str], None]) -> SessionState:
    """Carry out, or take up again, the session that `sitting` asks for; return its end.

    Raises:
        BadInput, StudyError, AddressError: something given is wrong; nothing was changed.
        DeviceError, JournalError, ParticipantGone: the work failed; the session can be resumed.
    """
    study = sitting.folder.study()
    url = sitting.device or study.rig.device
    pace = _checked_pace(sitting, url)
    seed = study.study.seed if sitting.seed is None else sitting.seed
    pseudonym(sitting.participant)
    with rigged(url, study.rig, sitting.touchbeam, seed) as rig:
        clock = _clock(pace, rig)
        with open_journal(sitting.folder.journal) as journal:
            session = _session(sitting, journal, url, seed)
            name = session_name(session.participant, session.number)
            log = SessionLog(journal, name, clock)
            if log.state.name == "completed":
                raise BadInput(f"{name} is complete; take another participant or --session")
            participant, operator = _people(sitting, session, rig, clock, say)
            run(session, rig.device, participant, operator, clock, log)
            return log.state


def _checked_pace(sitting: Sitting, url: str) -> Pace:
    """The pace asked for, or the one that fits; virtual ratings need a beam they can feel."""
    simulated = url == SIMULATED
    if sitting.ratings == "window":
        raise BadInput("--ratings window is not part of this version; use --ratings console")
    if sitting.ratings == "virtual" and not simulated:
        raise BadInput(f"--ratings virtual feels the simulated device only, got --device {url}")
    if sitting.pace == "stepped" and not (simulated and sitting.ratings == "virtual"):
        raise BadInput(
            "--pace stepped needs --device sim and --ratings virtual: a person takes time"
        )
    return sitting.pace or ("stepped" if sitting.ratings == "virtual" else "wall")


def _clock(pace: Pace, rig: Rigged) -> Clock:
    if pace == "wall" or rig.hand is None:
        return WallClock()
    return SteppedClock(WallClock().utc(), rig.hand.advance)


def _session(sitting: Sitting, journal: Journal, url: str, seed: int) -> Session:
    """The session as it was opened, or as it is to be opened now."""
    name = session_name(sitting.participant, sitting.number)
    text, study = sitting.folder.text(), sitting.folder.study()
    earlier = {key: journal.events(key)[0].payload for key in journal.sessions()}
    rehearsal = sitting.rehearsal or url == SIMULATED or sitting.ratings == "virtual"
    kind: Literal["participant", "rehearsal"] = "rehearsal" if rehearsal else "participant"
    if name in earlier:
        _require_same(earlier[name], text, kind, name)
    return Session(
        participant=sitting.participant,
        number=sitting.number,
        kind=kind,
        study=study,
        study_text=text,
        plan=plan(study, slot(earlier.values(), sitting.participant, kind)),
        language=sitting.language,
        consent=sitting.consent,
        seed=seed,
    )


def _require_same(opened: Mapping[str, Any], text: str, kind: str, name: str) -> None:
    """A session goes on as it began, or not at all."""
    if opened.get("study_sha256") != text_digest(text):
        raise BadInput(f"{name}: study.toml has changed since this session began; restore it")
    if opened["kind"] != kind:
        raise BadInput(f"{name} began as a {opened['kind']} session, now it would be a {kind} one")


def _people(
    sitting: Sitting, session: Session, rig: Rigged, clock: Clock, say: Callable[[str], None]
) -> tuple[Participant, Operator]:
    swapper = HandOperator(rig.hand, session.study.beams) if rig.hand else None
    if sitting.ratings == "virtual":
        assert rig.hand is not None
        assert swapper is not None
        stream = random.Random(f"virtual/{session.seed}/{session.participant}/{session.number}")
        virtual = VirtualParticipant(
            hand=rig.hand,
            clock=clock,
            character=drawn_character(stream),
            random_stream=stream,
        )
        return virtual, swapper
    typed = TypedLines(sys.stdin)
    participant = ConsoleParticipant(typed, say, session.language)
    if swapper is None:
        return participant, ConsoleOperator(typed, say)
    return participant, ConsoleOperator(typed, say, swapper.mount)
