"""The events of a journal: one record for each tag.

This is the contract between the sessions that write a journal and everything that reads one. Tags
and payload keys are written nowhere else; docs/reference/journal-events.md is generated
from this module.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated, Any, ClassVar

from protocol.journal import records
from protocol.journal.json_record import JsonRecord, Key, absent


@dataclass(frozen=True, kw_only=True)
class Event(JsonRecord):
    """Something that happened; its fields are the keys of its payload."""

    TAG: ClassVar[str]


SLIDE = "slide"
"""Stands for the participant of a sliding experiment; no pseudonym, because it has no digit."""
SCRIPT = "script"
"""The kind of what a program of one's own drove, and stands for its participant, too."""
NOBODY = frozenset({SLIDE, SCRIPT})
"""Stand for the participant where there is none: no report, export or slot counts them."""


@dataclass(frozen=True, kw_only=True)
class SessionOpened(Event):
    """A session begins: its participant and the whole plan."""

    TAG: ClassVar = "session-opened"
    REQUIRED: ClassVar = frozenset({"participant", "session", "kind", "conditions", "trials"})
    """The keys that every reader of a session needs."""

    participant: Annotated[
        str, Key("pseudonym of the participant; `slide` or `script` where there is none")
    ]
    session: Annotated[int, Key("number of the session, from 1", missing=1)]
    kind: Annotated[str, Key("`participant`, `rehearsal`, `slide` or `script`")]
    study: Annotated[str, Key("name of the study", missing="")]
    slot: Annotated[int | None, Key("place in the counterbalanced order, from 0", missing=None)]
    sequence: Annotated[tuple[str, ...], Key("conditions in the order of the plan", missing=())]
    conditions: Annotated[tuple[str, ...], Key("conditions in the order of the study file")]
    study_sha256: Annotated[str | None, Key("digest of the study file", missing=None)]
    study_text: Annotated[str | None, Key("the study file, with its own languages", missing=None)]
    trials: Annotated[tuple[records.PlannedTrial, ...], Key("all planned trials", missing=())]
    language: Annotated[str | None, Key("code of the participant's language", missing=None)]
    consent: Annotated[str | None, Key("reference of the signed consent, if any", missing=None)]
    seed: Annotated[
        int | None, Key("of the simulated device and the virtual participant", missing=None)
    ]
    virtual: records.VirtualTruth | None = absent(
        None, "the true parameters, if the participant is virtual"
    )
    versions: Annotated[Mapping[str, str], Key("of touchbeam and Python", missing={})]
    group: str | None = absent(
        None, "name of the participant's group, if the study has groups", sparse=True
    )
    override: str | None = absent(
        None, "why it began before or after it was due, if it did", sparse=True
    )
    answer_order: str = absent("forward", "of the answers to choose from: `forward` or `reversed`")
    registration: str | None = absent(
        None, "digest of the registration that seeds the plan, if any", sparse=True
    )
    calibration: records.RigCalibration | None = absent(
        None, "the rig's calibration in force, if there is one", sparse=True
    )


@dataclass(frozen=True, kw_only=True)
class SessionResumed(Event):
    """An interrupted session continues; everything that may have changed is recorded again."""

    TAG: ClassVar = "session-resumed"

    study_sha256: Annotated[str | None, Key("digest of the study file", missing=None)]
    study_text: Annotated[str | None, Key("the study file, with its own languages", missing=None)]
    trials: Annotated[
        tuple[records.PlannedTrial, ...], Key("all trials as planned under it", missing=())
    ]
    language: Annotated[str | None, Key("code of the participant's language", missing=None)]
    consent: Annotated[str | None, Key("reference of the signed consent, if any", missing=None)]
    seed: Annotated[
        int | None, Key("of the simulated device and the virtual participant", missing=None)
    ]
    virtual: records.VirtualTruth | None = absent(
        None, "the true parameters, if the participant is virtual"
    )
    versions: Annotated[Mapping[str, str], Key("of touchbeam and Python", missing={})]
    registration: str | None = absent(
        None, "digest of the registration that seeds the plan, if any", sparse=True
    )
    calibration: records.RigCalibration | None = absent(
        None, "the rig's calibration in force, if there is one", sparse=True
    )


@dataclass(frozen=True, kw_only=True)
class PracticeRenewed(Event):
    """Practice is repeated, after an interruption or too few touches as instructed."""

    TAG: ClassVar = "practice-renewed"

    indices: Annotated[tuple[int, ...], Key("numbers of the practice trials")]


@dataclass(frozen=True, kw_only=True)
class DeviceArmed(records.Identity, Event):
    """The device has identified itself, its limits are set, and its output is off."""

    TAG: ClassVar = "device-armed"


@dataclass(frozen=True, kw_only=True)
class WatchdogTested(Event):
    """The device heard nothing for longer than its watchdog's time, with its output on at 0 V."""

    TAG: ClassVar = "watchdog-tested"

    tripped: Annotated[bool, Key("whether it turned its output off")]
    idn: Annotated[str, Key("answer of the device to `*IDN?`")]
    address: Annotated[str, Key("where it was reached: `sim`, a serial port or a URL")]


@dataclass(frozen=True, kw_only=True)
class RigDescribed(Event):
    """The operator has answered the study's questions about the rig."""

    TAG: ClassVar = "rig-described"

    answers: Annotated[
        Mapping[str, str],
        Key("answer to each question, such as skin state, room temperature, cleaning", missing={}),
    ]


@dataclass(frozen=True, kw_only=True)
class BeamMounted(Event):
    """The operator has mounted a beam, with the output off."""

    TAG: ClassVar = "beam-mounted"

    beam: Annotated[str, Key("its name")]


@dataclass(frozen=True, kw_only=True)
class ResonanceMeasured(Event):
    """The beam's resonance has been measured."""

    TAG: ClassVar = "resonance-measured"

    frequency_hz: Annotated[float, Key("frequency of the peak, Hz")]
    tip_m_per_v: Annotated[float, Key("amplitude of the beam's tip at the peak, m per V")]


@dataclass(frozen=True, kw_only=True)
class TrialStarted(Event):
    """A trial begins, for the first time or again."""

    TAG: ClassVar = "trial-started"

    index: Annotated[int, Key("number of the trial")]
    kind: Annotated[str, Key("its kind, as planned")]


@dataclass(frozen=True, kw_only=True)
class TouchStarted(Event):
    """A touch begins; written before the output is switched on."""

    TAG: ClassVar = "touch-started"

    touch: Annotated[int, Key("number of the touch in its trial, from 0")]
    commanded: Annotated[records.CommandedDrive, Key("the drive at its beginning")]
    instruction: Annotated[
        records.InstructionResponse | None, Key("how the participant got ready", missing=None)
    ]


@dataclass(frozen=True, kw_only=True)
class TouchRecorded(records.Recording, Event):
    """What the force channel recorded; written after the output is off, before `touch-ended`."""

    TAG: ClassVar = "touch-recorded"

    touch: Annotated[int, Key("number of the touch in its trial, from 0")]


@dataclass(frozen=True, kw_only=True)
class TouchEnded(Event):
    """A touch is over; written after the output is off."""

    TAG: ClassVar = "touch-ended"

    touch: Annotated[int, Key("number of the touch in its trial, from 0")]
    read_back: Annotated[
        tuple[records.ReadBack, ...],
        Key(
            "read-back of the device at start and end, and five times a second in between if "
            "amplitude or frequency change",
            missing=(),
        ),
    ]
    trace: Annotated[
        tuple[records.TraceSample, ...],
        Key("device time (s), force (N) and position (m) of the finger", missing=()),
    ]
    judged: Annotated[
        records.Compliance, Key("whether it was as instructed", missing=records.NOT_JUDGED)
    ]


@dataclass(frozen=True, kw_only=True)
class DriveStarted(Event):
    """A program of one's own drives the rig; written before the setpoint is sent."""

    TAG: ClassVar = "drive-started"

    commanded: Annotated[records.CommandedDrive, Key("the drive")]


@dataclass(frozen=True, kw_only=True)
class DriveEnded(Event):
    """The program has turned the output off."""

    TAG: ClassVar = "drive-ended"

    read_back: Annotated[
        tuple[records.ReadBack, ...], Key("what the device said since the output went on")
    ]


@dataclass(frozen=True, kw_only=True)
class Answered(Event):
    """A trial is over and its questions are answered."""

    TAG: ClassVar = "answered"

    index: Annotated[int, Key("number of the trial")]
    kind: Annotated[str, Key("its kind, as planned")]
    condition: Annotated[str | None, Key("name of its condition, if it has one")]
    change: Annotated[str | None, Key("the answer, null if there was no question", missing=None)]
    agrees: Annotated[bool | None, Key("whether it is the expected answer", missing=None)]
    score: Annotated[int | None, Key("the score, null if none was given")]
    level: Annotated[float, Key("level of the trial, as planned", missing=1.0)]
    opposite: Annotated[bool, Key("whether its touches came in the opposite order", missing=False)]
    reaction_time_s: Annotated[tuple[float, ...], Key("time of each answer in turn, s", missing=())]
    traces: Annotated[
        tuple[Mapping[str, Any] | None, ...],
        Key("how each answer came about, see [the window](../window.md)", missing=()),
    ]
    judged: Annotated[
        tuple[records.Compliance, ...], Key("whether each touch was as instructed", missing=())
    ]
    questions: tuple[records.QuestionAnswer, ...] = absent(
        (), "the answers to the study's own questions after the trial"
    )
    track: records.TrackAnswer | None = absent(
        None, "of a track: its level, and whether the answer was right", sparse=True
    )


@dataclass(frozen=True, kw_only=True)
class QuestionAnswered(records.QuestionAnswer, Event):
    """A question of the study's own is answered, or the operator corrects an answer."""

    TAG: ClassVar = "question-answered"

    when: Annotated[str, Key("`desk`, `before`, `block` or `after`")]
    block: int | None = absent(None, "number of the block just over, if any")
    note: str | None = absent(
        None, "why the operator corrected the answer after the session began", sparse=True
    )


@dataclass(frozen=True, kw_only=True)
class TrialAborted(Event):
    """A trial ended before it was answered; it will be repeated."""

    TAG: ClassVar = "trial-aborted"

    index: Annotated[int, Key("number of the trial")]
    why: Annotated[str, Key("why", missing="")]


@dataclass(frozen=True, kw_only=True)
class TrialDeferred(Event):
    """A touch was not as instructed: the trial ended before its question and comes again."""

    TAG: ClassVar = "trial-deferred"

    index: Annotated[int, Key("number of the trial")]
    missed: Annotated[
        tuple[str, ...], Key("what was not as instructed: `force`, `place`, `speed`", missing=())
    ]
    after: Annotated[int, Key("number of the trial after which it comes; its own one: at once")]


@dataclass(frozen=True, kw_only=True)
class TrialsNotNeeded(Event):
    """A track has reached its stop: what is left of its trials is not run."""

    TAG: ClassVar = "trials-not-needed"

    track: Annotated[str, Key("name of the track")]
    indices: Annotated[tuple[int, ...], Key("numbers of the trials")]


@dataclass(frozen=True, kw_only=True)
class Paused(Event):
    """A pause requested by the operator begins."""

    TAG: ClassVar = "paused"


@dataclass(frozen=True, kw_only=True)
class Unpaused(Event):
    """The pause is over."""

    TAG: ClassVar = "unpaused"


@dataclass(frozen=True, kw_only=True)
class NoteTaken(Event):
    """The operator has made a note."""

    TAG: ClassVar = "note"

    text: Annotated[str, Key("what the operator typed", missing="")]


@dataclass(frozen=True, kw_only=True)
class DeviceOff(Event):
    """The device is no longer armed."""

    TAG: ClassVar = "device-off"

    confirmed: Annotated[bool, Key("whether the output was read back as off")]
    why: Annotated[str, Key("why it was turned off", missing="")]


@dataclass(frozen=True, kw_only=True)
class SessionCompleted(Event):
    """Every planned trial is answered."""

    TAG: ClassVar = "session-completed"


@dataclass(frozen=True, kw_only=True)
class TrialExcluded(Event):
    """A trial is excluded from the analysis."""

    TAG: ClassVar = "trial-excluded"

    index: Annotated[int, Key("number of the trial")]
    reason: Annotated[str, Key("why", missing="")]


@dataclass(frozen=True, kw_only=True)
class TrialIncluded(Event):
    """A trial's exclusion is taken back."""

    TAG: ClassVar = "trial-included"

    index: Annotated[int, Key("number of the trial")]
    reason: Annotated[str, Key("why", missing="")]


@dataclass(frozen=True, kw_only=True)
class SessionExcluded(Event):
    """The whole session is excluded from the analysis."""

    TAG: ClassVar = "session-excluded"

    reason: Annotated[str, Key("why", missing="")]


@dataclass(frozen=True, kw_only=True)
class SessionIncluded(Event):
    """The session's exclusion is taken back."""

    TAG: ClassVar = "session-included"

    reason: Annotated[str, Key("why", missing="")]


@dataclass(frozen=True, kw_only=True)
class Withdrawn(Event):
    """The participant has withdrawn: the payloads of all their sessions are erased."""

    TAG: ClassVar = "withdrawn"


@dataclass(frozen=True, kw_only=True)
class StudyAmended(Event):
    """A changed study file is accepted; recorded in the chain `@study`."""

    TAG: ClassVar = "study-amended"

    study_sha256: Annotated[str, Key("digest of the changed file")]
    reason: Annotated[str, Key("why", missing="")]
    breaks: str | None = absent(
        None, "digest of the registration whose lock it breaks, if any", sparse=True
    )


@dataclass(frozen=True, kw_only=True)
class StudyRegistered(Event):
    """Plan and analysis are locked; recorded in the chain `@study`."""

    TAG: ClassVar = "study-registered"

    registration: Annotated[str, Key("digest of the registration")]
    study_sha256: Annotated[str, Key("digest of the study file")]
    text: Annotated[str, Key("the file `registration.toml`")]


@dataclass(frozen=True, kw_only=True)
class ScoresImported(Event):
    """A subject of a published table: the only event of its session."""

    TAG: ClassVar = "scores-imported"
    kind: ClassVar = "published"
    slot: ClassVar = None
    group: ClassVar[str | None] = None
    trials: ClassVar[tuple[records.PlannedTrial, ...]] = ()
    """Constants in place of the fields of `SessionOpened`, since the table says nothing of them."""

    participant: Annotated[str, Key("the subject's name in the table")]
    session: Annotated[int, Key("number of the session", missing=1)]
    conditions: Annotated[tuple[str, ...], Key("conditions in the order of the table")]
    scores: Annotated[Mapping[str, float | None], Key("score of each condition, null if missing")]
    source: Annotated[str | None, Key("name of the file", missing=None)]
    source_sha256: Annotated[str | None, Key("digest of the file", missing=None)]


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


def terms_in(events: Iterable[StoredEvent]) -> Iterator[SessionTerms]:
    """Yield what the session runs under: as opened, then as resumed; nothing that is erased."""
    for event in events:
        if event.tag in {SessionOpened.TAG, SessionResumed.TAG} and not event.erased:
            record = event.record
            assert isinstance(record, SessionTerms)
            yield record
