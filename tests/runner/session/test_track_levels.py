"""Tracks in sessions: their levels follow from the answers in the journal, whatever happens."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest

from device.friction.calibration import NOMINAL
from device.tracks.next_level import levels_of
from protocol.errors import BadInput
from protocol.journal.events import Answered, StoredEvent, TouchStarted, TrialDeferred
from protocol.journal.records import TrackAnswer
from protocol.plan.plan import plan
from protocol.study_file.loading import parsed_study
from protocol.tracks.procedure import constant_order
from runner.journal.cohort import states
from runner.journal.opening import open_journal
from runner.journal.verification import verdicts
from runner.screens import Ask, FingerPath, Instruction, LeadIn, Notice, Pacing, Response
from runner.session.loop import require_resumable, run
from runner.session.session import SessionContext
from runner.study.tracks import solved_volts
from runner.window.preflight import foreseen
from tests.protocol.studies import TRACKS
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator, FakeParticipant, context
from tests.runner.session.test_as_instructed import Slipping

STAIRS = TRACKS.partition('[[track]]\nname = "felt"')[0]
FELT = STAIRS.partition("[[track]]")[0] + "[[track]]\n" + TRACKS.split("[[track]]\n")[2]
SHORT = TRACKS
for many, fewer in (
    ("= 9", "= 5"),
    ("= 7", "= 3"),
    ("= 6", "= 3"),
    ("reversals = 4", "reversals = 2"),
):
    SHORT = SHORT.replace(f"trials {many}", f"trials {fewer}").replace(many, fewer)


class KeptEvents:
    """A journal in memory, which begins with these events."""

    def __init__(self, events: list[StoredEvent]) -> None:
        self.all = [*events]

    def append(self, session: str, event: StoredEvent) -> None:
        self.all.append(event)

    def events(self, session: str) -> list[StoredEvent]:
        return [*self.all] if session == "P01/1" else []

    def sessions(self) -> list[str]:
        return ["P01/1"] if self.all else []

    def chain(self, session: str) -> list[Any]:
        return []

    def records_of(self, kind: type) -> list[Any]:
        return []

    def checkpoint(self) -> None:
        pass


@dataclass
class Answering(FakeParticipant):
    """Answers each trial by its place in the session alone, so that it answers alike again."""

    number: int = 0

    def progress(self, number: int, total: int) -> None:
        self.number = number

    def poll(self) -> Response | None:
        match self.shown[-1]:
            case Ask(question=question):
                drawn = crc32(f"1/{self.number}".encode())
                answer = question.values[drawn % len(question.values)]
                return Response(answer=answer, reaction_time_s=1.0)
        return super().poll()


@dataclass
class Naming(FakeParticipant):
    """Names the touch that `knows` tells from the trial's number, from 1; else a wrong one."""

    knows: Callable[[int], bool] = lambda _: True
    made: SessionContext | None = None

    def poll(self) -> Response | None:
        match self.shown[-1]:
            case Ask(question=question) if question.values:
                assert self.made is not None
                state = self.made.log.state
                trial = self.made.session.plan.trials[state.trial or 0]
                right = trial.expected or question.values[0]
                others = [each for each in question.values if each != right]
                answer = right if self.knows(len(state.answered) + 1) else others[0]
                return Response(answer=answer, reaction_time_s=1.0)
        return super().poll()


def begun(
    text: str,
    participant: FakeParticipant,
    events: list[StoredEvent] | None = None,
    device: FakeDevice | None = None,
    **orders: Any,
) -> tuple[SessionContext, list[StoredEvent]]:
    kept: Any = KeptEvents(events or [])
    made = context(kept, device or FakeDevice(), participant, text, **orders)
    volts = solved_volts(made.session.study, NOMINAL)
    made.session = replace(made.session, volts=volts)
    if isinstance(participant, Naming):
        participant.made = made
    return made, kept.all


def done(text: str, participant: FakeParticipant, **more: Any) -> list[StoredEvent]:
    made, events = begun(text, participant, **more)
    run(made)
    return events


def answers(events: list[StoredEvent]) -> list[Answered]:
    return [each for event in events if isinstance(each := event.record, Answered)]


def told(events: list[StoredEvent], name: str = "", role: str = "") -> list[TrackAnswer]:
    found = [each.track for each in answers(events) if each.track is not None]
    return [each for each in found if name in {"", each.name} and role in {"", each.role}]


METHODS = {
    "quest+": "",
    "constant": "",
    "staircase": 'rule = "2 down 1 up"\nstep_levels = [2, 1]\n',
    "limits": "",
}
INTERVALS = ("two intervals", "three intervals")
ASKED = [
    *((method, task) for method in METHODS for task in INTERVALS if method != "limits"),
    *((method, "yes or no") for method in METHODS),
]


def one_track(method: str, task: str, axis: str = "voltage") -> str:
    text = STAIRS.replace(
        'rule = "1 down 1 up"\nstep_levels = [1]\nup_step_levels = [2]\n', METHODS[method]
    )
    text = text.replace('method = "staircase"', f'method = "{method}"').replace(
        'task = "two intervals"', f'task = "{task}"'
    )
    if method == "constant":
        text = text.replace("trials = 9", "trials = 11")
    if method not in {"staircase", "limits"}:
        text = text.replace("stop = { reversals = 4 }\n", "")
    return text.replace('axis = "voltage"', f'axis = "{axis}"')


@pytest.mark.parametrize(("method", "task"), ASKED)
def test_each_method_and_task_asks_what_its_rule_says(method: str, task: str) -> None:
    text = one_track(method, task)
    study = parsed_study(text)
    (track,) = study.track
    device = FakeDevice()
    events = done(text, Answering(), device=device)
    levels = told(events, role="level")
    order = constant_order(track, study.study.seed, 1, 0) if method == "constant" else ()
    wanted = levels_of(track, [bool(each.correct) for each in levels], order)
    assert [each.level for each in levels] == [each.level for each in wanted]
    assert [each.value for each in levels] == [track.values[each.level] for each in wanted]
    # What was driven is the level, in the interval that was planned, and the standard elsewhere.
    driven = [record.commanded.voltage_v for event in events
              if isinstance(record := event.record, TouchStarted)]  # fmt: skip
    expected = [
        each.value or 0.0 if number == (each.interval or 1) else 0.0
        for each in told(events)
        for number in range(1, track.intervals + 1)
    ]
    assert driven == expected
    assert not device.on


def test_a_stop_makes_the_other_trials_of_its_track_needless() -> None:
    made, events = begun(STAIRS, Naming(knows=lambda number: number % 2 == 1))
    run(made)
    (stopped,) = [event.record for event in events if event.tag == "trials-not-needed"]
    assert stopped.track == "stairs"  # type: ignore[attr-defined]
    state = made.log.state
    assert state.name == "completed"
    assert state.answered | state.not_needed == set(range(12))
    assert state.answered.isdisjoint(state.not_needed)
    # The operator sees how many there are now, not how many there might have been.
    view = made.operator.seen[-1]  # type: ignore[attr-defined]
    assert view.progress() == f"{len(state.answered)} of {len(state.answered)} trials"


def test_a_stop_that_ends_a_block_and_the_session_leads_to_their_questions() -> None:
    own = "".join(
        f'[[question]]\nname = "own_{when}"\nkind = "number"\nwhen = "{when}"\nminimum = 0\n'
        'maximum = 9\ntext = { en = "How many?", zh = "?" }\n'
        for when in ("block", "after")
    )
    asking = Naming(
        knows=lambda number: number % 2 == 1, answers={"own_block": "3", "own_after": "4"}
    )
    events = done(STAIRS.replace("track_block = 8", "track_block = 20") + own, asking)
    tags = [event.tag for event in events]
    assert tags.index("trials-not-needed") < tags.index("question-answered")
    asked = [event.payload for event in events if event.tag == "question-answered"]
    assert [(each["when"], each["answer"]) for each in asked] == [("block", 3), ("after", 4)]


def test_a_track_that_reaches_its_last_trial_needs_all_catch_and_easy_trials() -> None:
    events = done(one_track("quest+", "two intervals"), Answering())
    assert "trials-not-needed" not in {event.tag for event in events}
    assert len(told(events)) == 12


def deferred_at(events: list[StoredEvent]) -> list[int]:
    return [record.index for event in events if isinstance(record := event.record, TrialDeferred)]


RETRIED = STAIRS.replace("[design]", "[as_instructed]\nretries = 2\n\n[design]")


def test_a_touch_that_was_not_as_instructed_comes_again_at_the_same_level() -> None:
    slips = iter([False] * 5 + [True] + [False] * 40)
    events = done(RETRIED, Answering(), device=Slipping(slips=slips))
    (again,) = deferred_at(events)
    starts = [event.payload["index"] for event in events if event.tag == "trial-started"]
    place = starts.index(again)
    assert starts[place + 1] == again, "at once"
    whole = done(RETRIED, Answering())
    assert answered_of(events) == answered_of(whole), "the same levels as without the slip"


def answered_of(events: list[StoredEvent]) -> list[tuple[int, str | None, TrackAnswer | None]]:
    return [(each.index, each.change, each.track) for each in answers(events)]


@pytest.mark.parametrize("state", ["touching", "trial"])
def test_a_trial_that_the_operator_repeats_is_made_at_the_same_level(state: str) -> None:
    device = FakeDevice()
    operator = FakeOperator(device, [(state, "repeat")])
    events = done(STAIRS, Answering(), device=device, operator=operator)
    assert sum(event.tag == "trial-aborted" for event in events) == 1
    assert answered_of(events) == answered_of(done(STAIRS, Answering()))


def test_a_session_cut_after_any_event_goes_on_as_if_it_had_not_been() -> None:
    whole = done(SHORT, Answering())
    first = next(place for place, event in enumerate(whole) if event.tag == "trial-started")
    for cut in range(1, len(whole)):
        events = done(SHORT, Answering(), events=whole[:cut])
        assert answered_of(events) == answered_of(whole), (cut, whole[cut - 1].tag)
        stopped = [
            [event.payload for event in those if event.tag == "trials-not-needed"]
            for those in (events, whole)
        ]
        assert stopped[0] == stopped[1]
    assert len(whole) > first + 40


def test_participants_read_which_touch_it_is_and_who_is_asked_of_one_does_not() -> None:
    participant = Answering()
    done(TRACKS, participant)
    numbers: dict[str, set[tuple[int, ...]]] = {}
    seen: list[int] = []
    for screen in participant.shown:
        match screen:
            case Pacing(interval=interval):
                seen.append(interval)
            case Ask(question=question):
                numbers.setdefault(question.name, set()).add(tuple(seen))
                seen = []
    assert numbers == {
        "which_smoother": {(1, 2)},
        "is_different": {(0,)},
        "which_different": {(1, 2, 3)},
    }


def seen_of_tracks(text: str) -> list[str | None]:
    device = FakeDevice()
    operator = FakeOperator(device)
    done(text, Answering(), device=device, operator=operator)
    return [view.track for view in operator.seen]


def test_the_operator_sees_where_a_track_stands_unless_blind() -> None:
    text = STAIRS.replace("trials = 9\nstop = { reversals = 4 }\ncatch = 2\neasy = 1", "trials = 4")
    seen = [track for track in dict.fromkeys(seen_of_tracks(text)) if track]
    first, *later = seen
    assert first == "stairs: level 10 (100 V), 0 reversals"
    assert len(later) == 3
    for told in later:
        assert re.fullmatch(
            r"stairs: level \d+ \([\d.]+ V\), [0-3] reversals?, "
            r"threshold [\d.]+ \([\d.]+ to [\d.]+\) V",
            told,
        ), told
    blind = text.replace("[session]", "[session]\nblind_operator = true")
    # Once the session is complete, nothing is hidden.
    assert {*seen_of_tracks(blind)} == {None, ""}


def test_every_page_of_a_session_with_tracks_is_foreseen() -> None:
    """So that each is known to fit, and drawn before it is needed."""
    participant = Answering()
    done(TRACKS, participant)
    known = foreseen(parsed_study(TRACKS), None)
    assert [screen for screen in participant.shown if screen not in known] == []


def around_touches(participant: FakeParticipant) -> Iterator[FingerPath]:
    for screen in participant.shown:
        match screen:
            case Instruction(touch=FingerPath() as path):
                yield path
            case LeadIn() | Pacing():
                yield FingerPath(
                    surface=screen.surface,
                    start_m=screen.start_m,
                    end_m=screen.end_m,
                    interval=screen.interval,
                )


def test_nothing_but_its_number_tells_the_touches_of_a_trial_apart() -> None:
    """The comparison must not be seen in what participants read."""
    participant = Answering()
    done(STAIRS, participant)
    assert len({replace(path, interval=0) for path in around_touches(participant)}) == 1
    assert {path.interval for path in around_touches(participant)} == {1, 2}


def test_feedback_says_whether_each_answer_was_right_where_one_is() -> None:
    text = STAIRS.replace("trials = 9", "trials = 9\nfeedback = true")
    participant = Answering()
    events = done(text, participant)
    notices = [
        screen.text.removeprefix("feedback.")
        for screen in participant.shown
        if isinstance(screen, Notice) and screen.text.startswith("feedback.")
    ]
    right = [each.correct for each in told(events) if each.role != "catch"]
    assert notices == ["right" if each else "wrong" for each in right]
    silent = Answering()
    done(STAIRS, silent)
    assert not any("feedback" in str(screen) for screen in silent.shown)


CONTRAST = STAIRS.replace('axis = "voltage"', 'axis = "contrast"').replace(
    "from = 10, to = 100", "from = 0.02, to = 0.3"
)


def test_contrasts_are_driven_at_the_voltages_of_the_calibrated_rig() -> None:
    made, events = begun(CONTRAST, Answering())
    volts = made.session.volts["stairs"]
    assert list(volts) == sorted(volts)
    assert volts[0] > 0
    device = made.device
    assert isinstance(device, FakeDevice)
    run(made)
    driven = {round(it.voltage_v, 6) for it in device.driven}
    levels = {each.level for each in told(events) if each.level is not None}
    assert driven == {0.0, *(round(volts[level], 6) for level in levels)}
    assert all(0.02 <= (each.value or 0.02) <= 0.3 for each in told(events))


PLACE = (
    STAIRS.replace('axis = "voltage"', 'axis = "place"')
    .replace("from = 10, to = 100", "from = 0.044, to = 0.064")
    .replace(
        'comparison = { place = "smooth" }', 'comparison = { place = "smooth", voltage_v = 50 }'
    )
    .replace('{ place = "smooth", voltage_v = 0 }', '{ place = "smooth", place_m = 0.04 }')
)


def test_places_are_shown_where_the_level_lies() -> None:
    participant = Answering()
    events = done(PLACE, participant)
    wanted = [
        each.value if each.interval == number else 0.04
        for each in told(events)
        for number in (1, 2)
    ]
    places = [screen.end_m for screen in participant.shown if isinstance(screen, Pacing)]
    assert places == wanted
    assert len(set(places)) > 3


def test_each_session_has_constant_stimuli_of_its_own(tmp_path: Path) -> None:
    text = FELT.replace("[design]", "[design]\nsessions = 2")
    study = parsed_study(text)
    (track,) = study.track
    orders = [constant_order(track, study.study.seed, number, 0) for number in (1, 2)]
    assert orders[0] != orders[1]
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), Answering(), text)
        made.session = replace(made.session, number=2, plan=plan(study, 0, 2))
        run(made)
        levels = [each.level for each in told(journal.events("P01/1"), role="level")]
        assert tuple(levels) == orders[1]


def test_a_study_of_tracks_alone_completes_and_verifies(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, FakeDevice(), Answering(), TRACKS))
        (verdict,) = verdicts(journal)
        assert verdict.ok, verdict.line()
        assert verdict.trials_planned == verdict.trials_answered


def test_a_session_is_not_resumed_at_other_levels(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant(), SHORT)
        asked = made.session.study.track[0]
        answer = TrackAnswer(
            name=asked.name,
            role="level",
            interval=None,
            level=1,
            value=asked.values[1],
            correct=True,
        )
        before = states(journal)["P01/1"]
        before.tracks[asked.name] = [answer]
        now = FakeClock().utc()
        require_resumable(journal, made.session, before, now)
        before.tracks[asked.name] = [replace(answer, value=asked.values[1] * 1.1)]
        with pytest.raises(BadInput, match=r"P01/1 cannot go on, .* other levels now"):
            require_resumable(journal, made.session, before, now)
        before.tracks[asked.name] = [replace(answer, level=len(asked.values))]
        with pytest.raises(BadInput, match="begin anew with --session 2 --extra"):
            require_resumable(journal, made.session, before, now)
