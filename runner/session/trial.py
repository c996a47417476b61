"""The parts of a trial: its touches, each with instruction and stimulus, and its questions."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from device.drivers.limits import SLOWEST_RAMP_V_PER_S, Setpoint
from device.errors import DeviceError
from protocol.journal import records
from protocol.journal.events import Answered, QuestionAnswered, TouchEnded, TouchStarted
from protocol.journal.state import SessionState
from protocol.plan.trials import Trial
from protocol.study.participant_texts import language, page_key
from protocol.study.study_question import (
    INTERVALS,
    QUESTIONS,
    Answer,
    StudyQuestion,
    When,
    facts_of_trial,
)
from protocol.study.touch import Touch
from runner import screens
from runner.session.measured import begin, end, judged, samples_of, tare
from runner.session.session import Session, SessionContext, known_before
from runner.session.setup import MOST_OVER_S, mount
from runner.session.track_levels import answered
from runner.session.waiting import TICK_S, response, show_page, update_view, wait

Due = tuple[When, int | None, StudyQuestion]
"""When a question is asked, and after which block if it is asked after one."""


def asked(context: SessionContext, screen: screens.Ask) -> tuple[Answer, screens.Response]:
    """Return what the answer means, and the response; raises `ValueError` if it is not allowed."""
    # Only what is shown is turned, so that answers keep their names and the data stay the same.
    values, shown = screen.question.values, screen
    # Nobody wants to find the second touch before the first one.
    if values and context.session.answer_order == "reversed" and {*values}.isdisjoint(INTERVALS):
        shown = replace(screen, question=screen.question.reversed())
    show_page(context, shown)
    given = response(context)
    return screen.question.answer(given.answer), given


def ask_due(context: SessionContext) -> None:
    """Ask and record what is due between trials and has not been answered yet."""
    # Each answer is stored by itself, so that a session that is interrupted asks only what is left,
    # and each may decide on what is asked next.
    while left := due(context.session, context.log.state):
        when, block, question = left[0]
        given = _asked(context, question)
        context.log.append(QuestionAnswered(when=when, block=block, **vars(given)))
        context.participant.saved()


def read_pages(context: SessionContext, before: str, block: int = 0) -> None:
    """Show the study's own pages before the session, practice or a block, one after another."""
    study = context.session.study
    for number in study.pages(before, block):
        picture = study.page[number].picture
        show_page(context, screens.Instruction(text=page_key(number), picture=picture))
        response(context)


def introduce(context: SessionContext, trial: Trial, last: Trial | None) -> None:
    """Say that practice begins if `trial` begins it after `last`; show its pages, or a block's."""
    if trial.kind == "practice" and (last is None or last.kind != "practice"):
        show_page(context, screens.Instruction(text="practice"))
        response(context)
        read_pages(context, "practice")
    elif trial.block > 0 and (last is None or last.block != trial.block):
        read_pages(context, "block", trial.block)


def due(session: Session, state: SessionState) -> list[Due]:
    """Return the study's own questions that are due in `state`, in the order of asking."""
    return [
        (when, block, question)
        for when, block in _times(session, state)
        for question in session.study.questions(when, session.number)
        if (question.name, block) not in state.questions
        and question.follows(known_before(session, state, block))
    ]


def _times(session: Session, state: SessionState) -> Iterator[tuple[When, int | None]]:
    trials = session.plan.trials
    over = state.answered | state.not_needed
    left = {trial.block for trial in trials if trial.index not in over}
    yield "before", None
    # Of the last block that was begun alone: what is answered later is about another one.
    block = max((trial.block for trial in trials if trial.index in state.begun), default=0)
    if block not in {*left, 0}:  # block 0 is what comes before the first one, such as practice
        yield "block", block
    if not left:
        yield "after", None


def _asked(context: SessionContext, question: StudyQuestion) -> records.QuestionAnswer:
    letters = language(context.session.study, context.session.language).letters
    answer, given = asked(context, screens.Ask(question=question, letters=letters))
    return records.QuestionAnswer(**{**vars(given), "name": question.name, "answer": answer})


SAMPLE_EVERY_S = 0.2
SWEEP_STEP_S = 0.1
SWEEP_STEPS = 10
"""Steps in a sweep shorter than 1 s; fewer if they would be shorter than `FASTEST_STEP_S`."""
FASTEST_STEP_S = 0.02


def touch(
    context: SessionContext, number: int, to_make: Touch, interval: int = 0
) -> records.Compliance:
    """Carry out one touch of a trial and return its compliance.

    Participants read which touch of several it is, `interval` from 1; 0 where they do not.

    The output is off before and after the touch. It is switched on only after the journal has
    recorded the commanded setpoint.
    """
    study, to_make = context.session.study, to_make.at(context.resonance_hz)
    mount(context, to_make.beam or study.touch.beam)
    if number > 0:
        wait(context, study.timing.between_touches_s)
    # Before the instruction, because the finger comes to the beam after it.
    drifted = tare(context)
    stimulus = _Stimulus(context, to_make, interval)
    path = stimulus.pacing.touch
    show_page(context, screens.Instruction(text=stimulus.pacing.text, touch=path))
    ready = records.InstructionResponse(**vars(response(context)))
    start = _setpoint(context, to_make.voltage_v, to_make.frequency)
    # On the disk before the output goes on: no touch is driven of which the journal does not know.
    context.log.append(TouchStarted(touch=number, commanded=start, instruction=ready))
    moved_s = stimulus.deliver(start)
    # Off before anything is shown or stored, because neither may keep it on.
    context.device.off()
    stimulus.require_as_long_as_planned()
    show_page(context, screens.Notice(text="touch.end"))
    # Before `touch-ended`: a session killed between the two repeats the trial and loses no samples.
    warnings = end(context, number, moved_s)
    verdict = judged(stimulus.pacing, stimulus.samples, study.as_instructed)
    said, felt = tuple(stimulus.read_back), tuple(stimulus.samples)
    context.log.append(TouchEnded(touch=number, read_back=said, trace=felt, judged=verdict))
    if verdict.missed:
        missed = " and ".join(verdict.missed)
        warnings.append(f"the touch did not follow the instruction: {missed}")
    update_view(context, warning="; ".join(filter(None, [drifted, *warnings])))
    return verdict


class _Stimulus:
    """The drive during one touch, with the read-backs and finger samples taken."""

    def __init__(self, context: SessionContext, to_make: Touch, interval: int) -> None:
        self._context, self._touch = context, to_make
        self._next_sample_s = self._look_s = 0.0
        self.read_back: list[records.ReadBack] = []
        self.samples: list[records.TraceSample] = []
        finger, surface = context.session.study.touch, context.surface
        self.pacing = screens.pacing(to_make, finger, interval, surface)
        self._next_step_s = self._step_s
        rule, running = context.session.study.as_instructed.feedback, context.log.state.trial
        kinds = {trial.kind for trial in context.order if trial.index == running}
        self._shows_finger = rule == "always" or (rule == "practice" and "practice" in kinds)
        """Whether participants see their own finger in the running trial."""

    def deliver(self, start: Setpoint) -> tuple[float, float]:
        """Lead in at `start`, then run the touch with its ramp and sweep; leave the output on.

        The soft start is over before the mark moves. Returns when it began to move, and when the
        touch was over.
        """
        context, to_make = self._context, self._touch
        begin(context)
        before = screens.lead_in(self.pacing, context.session.study.touch)
        moves_s = context.clock.monotonic_s() + before.seconds
        # The finger is put down while the output rises, on the same page whatever is driven.
        show_page(context, before)
        asked_s, ramp_s = context.clock.monotonic_s(), start.voltage_v / start.ramp_v_per_s
        said = context.device.drive(start)
        begun_s = context.clock.monotonic_s()
        # The output may be on from the beginning of this call: who stands still in it is late.
        slowest_s = asked_s + (context.device.pace.begin_s if context.device.pace else 0.0)
        self._ends_s = max(moves_s, min(begun_s, slowest_s) + ramp_s) + self.pacing.duration_s
        # A soft start may outlast the lead-in; a held drive is steady before the mark moves.
        moves_s = max(moves_s, begun_s + ramp_s)
        update_view(context, device=said)
        while (left_s := moves_s - context.clock.monotonic_s()) > 1e-9:  # rounding of summed ticks
            wait(context, min(left_s, SAMPLE_EVERY_S))
            if self._has_time_to_look(moves_s):  # as often as later, to notice a fault
                self._show_finger(self._looked())
        moved_s = context.clock.monotonic_s()
        show_page(context, self.pacing)
        self._sample_and_show()
        if self._ramps:
            # A ramp begins with the mark, not with the lead-in: its course belongs to the path.
            self._drive_at(0.0)
        self._began_s = context.clock.monotonic_s()
        # A short sweep takes its steps more often than an ordinary tick comes.
        wait(context, self.pacing.duration_s, self._on_tick, min(TICK_S, self._step_s))
        over_s = context.clock.monotonic_s()
        # The last tick comes before the end: without this a sweep would stop short of its end.
        last = self._drive_at(1.0) if to_make.sweep_to is not None else None
        self._sample_and_show(last)
        return moved_s, over_s

    def require_as_long_as_planned(self) -> None:
        """Raise `DeviceError` if the output, now off, was on for much longer than planned.

        So it does if anything stood still meanwhile.
        """
        self._context.device.beat()
        over_s = self._context.clock.monotonic_s() - self._ends_s
        if over_s > MOST_OVER_S:
            raise DeviceError(
                f"a touch of {self.pacing.duration_s:g} s ended {over_s:.1f} s late, because this "
                "computer or the device was too slow; it does not count"
            )

    def _sample_and_show(self, read_back: records.ReadBack | None = None) -> None:
        update_view(self._context, device=self._sample(read_back, keep=True))

    def _looked(self) -> records.ReadBack:
        begin_s = self._context.clock.monotonic_s()
        read_back = self._context.device.read_back()
        self._look_s = self._context.clock.monotonic_s() - begin_s
        return read_back

    def _has_time_to_look(self, until_s: float) -> bool:
        """Return whether a look ends before `until_s`, however slow the device is."""
        return self._context.clock.monotonic_s() + self._look_s <= until_s + 1e-9

    def _sample(self, read_back: records.ReadBack | None = None, *, keep: bool) -> records.ReadBack:
        read_back = read_back or self._looked()
        if keep:
            self.read_back.append(read_back)
        self.samples += samples_of(read_back)
        self._show_finger(read_back)
        return read_back

    def _show_finger(self, read_back: records.ReadBack) -> None:
        within = self._context.session.study.as_instructed.force_within
        for sample in samples_of(read_back) if self._shows_finger else ():
            at_m, force = sample.position_m, sample.force_n / self.pacing.force_n
            finger = screens.OwnFinger(position_m=at_m, force=force, within=within)
            self._context.participant.felt(finger)

    @property
    def _step_s(self) -> float:
        return min(SWEEP_STEP_S, max(self.pacing.duration_s / SWEEP_STEPS, FASTEST_STEP_S))

    @property
    def _ramps(self) -> bool:
        return self._touch.end_voltage_v != self._touch.voltage_v

    def _on_tick(self) -> None:
        """Sample the finger when a sample is due; take the next step of a sweep when it is due."""
        passed_s = self._context.clock.monotonic_s() - self._began_s
        sweeps = self._touch.sweep_to is not None
        in_time = self._has_time_to_look(self._began_s + self.pacing.duration_s)
        if passed_s >= self._next_sample_s and in_time:
            # Added up, not counted from now, so that a late tick delays no later sample.
            self._next_sample_s += SAMPLE_EVERY_S
            # Each read-back of a changing drive is kept; of a constant one, the first and the last.
            self._sample(keep=sweeps or self._ramps)
        if sweeps and passed_s >= self._next_step_s and in_time:
            self._next_step_s += self._step_s
            self._drive_at(min(passed_s / self.pacing.duration_s, 1.0))

    def _drive_at(self, share: float) -> records.ReadBack:
        """Set the frequency at `share` (0 to 1) of the sweep, and the end of the amplitude ramp.

        Return what the device says of it.
        """
        to_make = self._touch
        frequency = to_make.frequency + share * (to_make.end_frequency - to_make.frequency)
        change_v = abs(to_make.end_voltage_v - to_make.voltage_v)
        target = _setpoint(self._context, to_make.end_voltage_v, frequency)
        if self._ramps:  # the device itself ramps, evenly over the touch
            slope = max(change_v / self.pacing.duration_s, SLOWEST_RAMP_V_PER_S)
            # Never steeper than the rig's soft start.
            target = replace(target, ramp_v_per_s=min(slope, target.ramp_v_per_s))
        return self._context.device.drive(target)


def _setpoint(context: SessionContext, voltage_v: float, frequency: float) -> Setpoint:
    return Setpoint(
        voltage_v=voltage_v,
        frequency_hz=frequency * context.resonance_hz,
        ramp_v_per_s=context.session.study.rig.ramp_v_per_s,
    )


def ask(context: SessionContext, trial: Trial, judged: Sequence[records.Compliance]) -> Answered:
    """Ask about `trial`, whose touches are `judged`; return the event with the answers."""
    change, score, given = _answers(context, trial)
    known = known_before(context.session, context.log.state)
    known |= facts_of_trial(trial.question, change, trial.expected, score)
    own: list[records.QuestionAnswer] = []
    for question in context.session.study.questions_after(trial.condition):
        if question.follows(known):
            own.append(_asked(context, question))
            known[question.name] = own[-1].answer
    return Answered(
        index=trial.index,
        kind=trial.kind,
        condition=trial.condition,
        change=change,
        agrees=None if change is None or trial.expected is None else change == trial.expected,
        score=score,
        level=trial.level,
        opposite=trial.opposite,
        reaction_time_s=tuple(entry.reaction_time_s for entry in given),
        traces=tuple(entry.trace for entry in given),
        judged=tuple(judged),
        questions=tuple(own),
        track=answered(context.session, context.log.state, trial, change),
    )


def _answers(
    context: SessionContext, trial: Trial
) -> tuple[str | None, int | None, list[screens.Response]]:
    """Return the reported change, its score, and the responses that gave them.

    The score is None where the answer asks for none, which `rating.score_when` decides (in the
    paper, section 5.2, an answer that disagrees with the expectation). Without a question about a
    change the score is all that is asked, and no change is reported.
    """
    # A block that is drawn along the beam answers nothing.
    if trial.kind == "pass":
        return None, None, []
    if trial.track is not None:
        track = context.session.study.track_of(trial.track.name)
        said, given = asked(context, screens.ask_track(track.found, track.intervals))
        return str(said), None, [given]
    rating = context.session.study.rating
    if trial.rated:
        score, given = asked(context, screens.ask_rating(rating))
        assert isinstance(score, int), "scores are whole"
        return None, score, [given]
    # A trial to remember, such as the baseline, has no question; the participant only confirms.
    if trial.question is None:
        show_page(context, screens.Instruction(text="remember"))
        return None, None, [response(context)]
    _, change = asked(context, screens.ask_change(trial.question))
    agrees = change.answer == trial.expected
    noticed = change.answer != QUESTIONS[trial.question].same
    if not (trial.scored and rating.asks_score(agrees=agrees, noticed=noticed)):
        return change.answer, None, [change]
    score, given = asked(context, screens.ask_score(rating))
    assert isinstance(score, int), "scores are whole"
    return change.answer, score, [change, given]
