"""The events of a journal: one record for each tag.

This is the contract between the sessions that write a journal and everything that reads one. Tags
and payload keys are written nowhere else; docs/reference/journal-events.md is generated
from this module.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, ClassVar

from protocol.journal import records
from protocol.journal.json_record import JsonRecord, absent, key, sparse


class Event(JsonRecord):
    """Something that happened; its fields are the keys of its payload."""

    TAG: ClassVar[str]

    def __init_subclass__(cls, tag: str) -> None:
        super().__init_subclass__()
        cls.TAG = tag


SLIDE = "slide"
"""Stands for the participant of a sliding experiment; no pseudonym, because it has no digit."""
SCRIPT = "script"
"""The kind of what a program of one's own drove, and stands for its participant, too."""
NOBODY = frozenset({SLIDE, SCRIPT})
"""Stand for the participant where there is none: no report, export or slot counts them."""


class SessionOpened(Event, tag="session-opened"):
    """A session begins: its participant and the whole plan."""

    REQUIRED: ClassVar = frozenset({"participant", "session", "kind", "conditions", "trials"})
    """The keys that every reader of a session needs."""

    participant: str = key("pseudonym of the participant; `slide` or `script` where there is none")
    session: int = key("number of the session, from 1", missing=1)
    kind: str = key("`participant`, `rehearsal`, `slide` or `script`")
    study: str = key("name of the study", missing="")
    slot: int | None = key("place in the counterbalanced order, from 0", missing=None)
    sequence: tuple[str, ...] = key("conditions in the order of the plan", missing=())
    conditions: tuple[str, ...] = key("conditions in the order of the study file")
    study_sha256: str | None = key("digest of the study file", missing=None)
    study_text: str | None = key("the study file, with its own languages", missing=None)
    trials: tuple[records.PlannedTrial, ...] = key("all planned trials", missing=())
    language: str | None = key("code of the participant's language", missing=None)
    consent: str | None = key("reference of the signed consent, if any", missing=None)
    seed: int | None = key(missing=None, any_size=True)
    """of the simulated device and the virtual participant"""
    virtual: records.VirtualTruth | None = absent(None)
    """the true parameters, if the participant is virtual"""
    versions: Mapping[str, str] = key("of touchbeam and Python", missing={})
    group: str | None = sparse("name of the participant's group, if the study has groups")
    override: str | None = sparse("why it began before or after it was due, if it did")
    answer_order: str = absent("forward", "of the answers to choose from: `forward` or `reversed`")
    registration: str | None = sparse("digest of the registration that seeds the plan, if any")
    calibration: records.RigCalibration | None = sparse()
    """the rig's calibration in force, if there is one"""


class SessionResumed(Event, tag="session-resumed"):
    """An interrupted session continues; everything that may have changed is recorded again."""

    study_sha256: str | None = key("digest of the study file", missing=None)
    study_text: str | None = key("the study file, with its own languages", missing=None)
    trials: tuple[records.PlannedTrial, ...] = key("all trials as planned under it", missing=())
    language: str | None = key("code of the participant's language", missing=None)
    consent: str | None = key("reference of the signed consent, if any", missing=None)
    seed: int | None = key(missing=None, any_size=True)
    """of the simulated device and the virtual participant"""
    virtual: records.VirtualTruth | None = absent(None)
    """the true parameters, if the participant is virtual"""
    versions: Mapping[str, str] = key("of touchbeam and Python", missing={})
    registration: str | None = sparse("digest of the registration that seeds the plan, if any")
    calibration: records.RigCalibration | None = sparse()
    """the rig's calibration in force, if there is one"""


class PracticeRenewed(Event, tag="practice-renewed"):
    """Practice is repeated, after an interruption or too few touches as instructed."""

    indices: tuple[int, ...] = key("numbers of the practice trials")


class DeviceArmed(records.Identity, Event, tag="device-armed"):
    """The device has identified itself, its limits are set, and its output is off."""


class WatchdogTested(Event, tag="watchdog-tested"):
    """The device heard nothing for longer than its watchdog's time, with its output on at 0 V."""

    tripped: bool = key("whether it turned its output off")
    idn: str = key("answer of the device to `*IDN?`")
    address: str = key("where it was reached: `sim`, a serial port or a URL")


class RigDescribed(Event, tag="rig-described"):
    """The operator has answered the study's questions about the rig."""

    answers: Mapping[str, str] = key(missing={})
    """answer to each question, such as skin state, room temperature, cleaning"""


class BeamMounted(Event, tag="beam-mounted"):
    """The operator has mounted a beam, with the output off."""

    beam: str = key("its name")


class ResonanceMeasured(Event, tag="resonance-measured"):
    """The beam's resonance has been measured."""

    frequency_hz: float = key("frequency of the peak, Hz")
    tip_m_per_v: float = key("amplitude of the beam's tip at the peak, m per V")


class TrialStarted(Event, tag="trial-started"):
    """A trial begins, for the first time or again."""

    index: int = key("number of the trial")
    kind: str = key("its kind, as planned")


class TouchStarted(Event, tag="touch-started"):
    """A touch begins; written before the output is switched on."""

    touch: int = key("number of the touch in its trial, from 0")
    commanded: records.CommandedDrive = key("the drive at its beginning")
    instruction: records.InstructionResponse | None = key(missing=None)
    """how the participant got ready"""


class TouchRecorded(records.Recording, Event, tag="touch-recorded"):
    """What the force channel recorded; written after the output is off, before `touch-ended`."""

    touch: int = key("number of the touch in its trial, from 0")


class TouchEnded(Event, tag="touch-ended"):
    """A touch is over; written after the output is off."""

    touch: int = key("number of the touch in its trial, from 0")
    read_back: tuple[records.ReadBack, ...] = key(missing=())
    """read-back of the device at start and end, and five times a second in between if amplitude or
    frequency change"""
    trace: tuple[records.TraceSample, ...] = key(missing=())
    """device time (s), force (N) and position (m) of the finger"""
    judged: records.Compliance = key("whether it was as instructed", missing=records.NOT_JUDGED)


class DriveStarted(Event, tag="drive-started"):
    """A program of one's own drives the rig; written before the setpoint is sent."""

    commanded: records.CommandedDrive = key("the drive")


class DriveEnded(Event, tag="drive-ended"):
    """The program has turned the output off."""

    read_back: tuple[records.ReadBack, ...] = key("what the device said since the output went on")


class Answered(Event, tag="answered"):
    """A trial is over and its questions are answered."""

    index: int = key("number of the trial")
    kind: str = key("its kind, as planned")
    condition: str | None = key("name of its condition, if it has one")
    change: str | None = key("the answer, null if there was no question", missing=None)
    agrees: bool | None = key("whether it is the expected answer", missing=None)
    score: int | None = key("the score, null if none was given")
    level: float = key("level of the trial, as planned", missing=1.0)
    opposite: bool = key("whether its touches came in the opposite order", missing=False)
    reaction_time_s: tuple[float, ...] = key("time of each answer in turn, s", missing=())
    traces: tuple[Mapping[str, Any] | None, ...] = key(missing=())
    """how each answer came about, see [the window](../window.md)"""
    judged: tuple[records.Compliance, ...] = key("whether each touch was as instructed", missing=())
    questions: tuple[records.QuestionAnswer, ...] = absent(())
    """the answers to the study's own questions after the trial"""
    track: records.TrackAnswer | None = sparse()
    """of a track: its level, and whether the answer was right"""


class QuestionAnswered(records.QuestionAnswer, Event, tag="question-answered"):
    """A question of the study's own is answered, or the operator corrects an answer."""

    when: str = key("`desk`, `before`, `block` or `after`")
    block: int | None = absent(None, "number of the block just over, if any")
    note: str | None = sparse("why the operator corrected the answer after the session began")
    moot: tuple[str, ...] | None = sparse()
    """of a correction: questions of the desk that depend on it and would not be asked now; their
    answers do not count"""


class TrialAborted(Event, tag="trial-aborted"):
    """A trial ended before it was answered; it will be repeated."""

    index: int = key("number of the trial")
    why: str = key("why", missing="")


class TrialDeferred(Event, tag="trial-deferred"):
    """A touch was not as instructed: the trial ended before its question and comes again."""

    index: int = key("number of the trial")
    missed: tuple[str, ...] = key(missing=())
    """what was not as instructed: `force`, `place`, `speed`"""
    after: int = key("number of the trial after which it comes; its own one: at once")


class TrialsNotNeeded(Event, tag="trials-not-needed"):
    """A track has reached its stop: what is left of its trials is not run."""

    track: str = key("name of the track")
    indices: tuple[int, ...] = key("numbers of the trials")


class Paused(Event, tag="paused"):
    """A pause requested by the operator begins."""


class Unpaused(Event, tag="unpaused"):
    """The pause is over."""


class NoteTaken(Event, tag="note"):
    """The operator has made a note."""

    text: str = key("what the operator typed", missing="")


class WindowChanged(Event, tag="window-changed"):
    """The participant's window opened, got or lost the keyboard, was minimised or came back."""

    has_keys: bool = key("whether keys of this computer's keyboard reach it")
    is_shown: bool = key("whether it is on the screen, not minimised")


class DeviceOff(Event, tag="device-off"):
    """The device is no longer armed."""

    confirmed: bool = key("whether the output was read back as off")
    why: str = key("why it was turned off", missing="")


class SessionCompleted(Event, tag="session-completed"):
    """Every planned trial is answered."""


class TrialExcluded(Event, tag="trial-excluded"):
    """A trial is excluded from the analysis."""

    index: int = key("number of the trial")
    reason: str = key("why", missing="")


class TrialIncluded(Event, tag="trial-included"):
    """A trial's exclusion is taken back."""

    index: int = key("number of the trial")
    reason: str = key("why", missing="")


class SessionExcluded(Event, tag="session-excluded"):
    """The whole session is excluded from the analysis."""

    reason: str = key("why", missing="")


class SessionIncluded(Event, tag="session-included"):
    """The session's exclusion is taken back."""

    reason: str = key("why", missing="")


class Withdrawn(Event, tag="withdrawn"):
    """The participant has withdrawn: the payloads of all their sessions are erased."""


class StudyAmended(Event, tag="study-amended"):
    """A changed study file is accepted; recorded in the chain `@study`."""

    study_sha256: str = key("digest of the changed file")
    reason: str = key("why", missing="")
    breaks: str | None = sparse("digest of the registration whose lock it breaks, if any")


class StudyRegistered(Event, tag="study-registered"):
    """Plan and analysis are locked; recorded in the chain `@study`."""

    registration: str = key("digest of the registration")
    study_sha256: str = key("digest of the study file")
    text: str = key("the file `registration.toml`")


class ScoresImported(Event, tag="scores-imported"):
    """A subject of an imported table: the only event of its session."""

    kind: ClassVar = "published"
    slot: ClassVar = None
    trials: ClassVar[tuple[records.PlannedTrial, ...]] = ()
    """Constants in place of the fields of `SessionOpened`, since the table says nothing of them."""

    participant: str = key("the subject's name in the table")
    session: int = key("number of the session", missing=1)
    conditions: tuple[str, ...] = key("conditions in the order of the table")
    scores: Mapping[str, float | None] = key("score of each condition, null if missing")
    source: str | None = key("name of the file", missing=None)
    source_sha256: str | None = key("digest of the file", missing=None)
    group: str | None = sparse("the subject's group, if the table has groups")
    ratings: tuple[records.ImportedRating, ...] | None = sparse()
    """where the table has repeats, answers or contrasts: all ratings in its order; `scores` are
    then the means"""


UNKNOWN_UTC = datetime(1970, 1, 1, tzinfo=UTC)
"""When everything began in a journal that an earlier version imported from a data set, which did
not tell the time of day."""
Opening = SessionOpened | ScoresImported
"""The first event of a session."""
SessionTerms = SessionOpened | SessionResumed
"""What a session runs under from here on: study, plan, language, registration, calibration."""

# A record becomes an event by being defined here: no list of them can be out of date.
EVENTS: tuple[type[Event], ...] = tuple(Event.__subclasses__())
"""In the order in which they are defined above."""
TAGS: Mapping[str, type[Event]] = {event.TAG: event for event in EVENTS}


def event_of(tag: str, payload: Mapping[str, Any]) -> Event:
    """Return the event stored in a journal as `tag` and `payload`.

    An unknown tag or a missing key is a KeyError; a value of a shape that no build has written a
    TypeError or AttributeError.
    """
    return TAGS[tag].from_json(payload)


@dataclass(frozen=True, kw_only=True, slots=True)
class StoredEvent:
    """An event as stored in a session's chain; its payload is empty once erased."""

    seq: int
    tag: str
    utc: datetime
    monotonic_s: float
    payload: Mapping[str, Any]
    erased: bool = False
    _parsed: Event | None = field(default=None, init=False, repr=False, compare=False)

    @property
    def record(self) -> Event:
        """The event, parsed at the first access; it is lost once erased. Raises as `event_of`."""
        if self._parsed is None:  # who verifies a session and who analyses it both ask
            # The record is frozen for everybody else. What is parsed follows from the payload, so
            # that comparing and printing leave it out.
            object.__setattr__(self, "_parsed", event_of(self.tag, self.payload))
        assert self._parsed is not None
        return self._parsed

    def damage(self) -> str:
        """Return what no build has written in it, or nothing; its tag must be known."""
        wrong = "" if self.erased else TAGS[self.tag].misfit(self.payload)
        return wrong and f"event {self.seq} is damaged: {self.tag}, {wrong}"


def terms_in(events: Iterable[StoredEvent]) -> Iterator[SessionTerms]:
    """Yield what the session runs under: as opened, then as resumed; nothing that is erased."""
    for event in events:
        if event.tag in {SessionOpened.TAG, SessionResumed.TAG} and not event.erased:
            record = event.record
            assert isinstance(record, SessionTerms)
            yield record
