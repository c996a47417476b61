"""One touch: the right beam, the instruction, the drive, the finger's way, and off again."""

from collections.abc import Sequence
from dataclasses import replace

from device.drivers.setpoints import SLOWEST_RAMP_V_PER_S, Setpoint
from protocol.journal.events import Answered, TouchEnded, TouchStarted
from protocol.journal.records import Compliance, InstructionResponse, ReadBack, TraceSample
from protocol.plan.trials import Trial
from protocol.study.questions import checked_answer
from protocol.study.texts import touch_text
from protocol.study.touch import Touch
from runner.screens import AskChange, AskScore, Instruction, Notice, Response, pacing
from runner.session.compliance import judged, samples_of
from runner.session.session import SessionContext
from runner.session.setup import mount
from runner.session.tick import TICK_S, response, update_view, wait

SAMPLE_EVERY_S = 0.2
SWEEP_STEP_S = 0.1
SWEEP_STEPS = 10
"""Of a sweep that is shorter than 1 s, as far as `FASTEST_STEP_S` allows."""
FASTEST_STEP_S = 0.02


def touch(context: SessionContext, number: int, to_make: Touch) -> Compliance:
    """Carry out one touch of a trial and return how it was done.

    The output is off before and after it; it goes on only once the journal says that it will.
    """
    study = context.session.study
    mount(context, to_make.beam or study.touch.beam)
    if number > 0:
        wait(context, study.timing.between_touches_s)
    ready = _instructed(context, to_make)
    start = _setpoint(context, to_make.voltage_v, to_make.frequency)
    context.log.append(
        TouchStarted(
            touch=number,
            commanded=start,
            instruction=InstructionResponse(
                answer=ready.answer, reaction_time_s=ready.reaction_time_s, trace=ready.trace
            ),
        )
    )
    stimulus = _Stimulus(context, to_make)
    stimulus.deliver(start)
    context.device.off()
    context.participant.show(Notice(text="touch.end"))
    verdict = judged(stimulus.pacing, stimulus.samples)
    context.log.append(
        TouchEnded(
            touch=number,
            read_back=tuple(stimulus.read_back),
            trace=tuple(stimulus.samples),
            judged=verdict,
        )
    )
    update_view(context, warning=_warning(verdict))
    return verdict


def _instructed(context: SessionContext, to_make: Touch) -> Response:
    """Say how to touch, and nothing else, until the participant is ready."""
    way = pacing(to_make, context.session.study.touch).touch
    context.participant.show(Instruction(text=touch_text(to_make), touch=way))
    return response(context)


class _Stimulus:
    """What the device does while the finger is on the beam, and what was read back meanwhile."""

    def __init__(self, context: SessionContext, to_make: Touch) -> None:
        self._context = context
        self._touch = to_make
        self._next_sample_s = 0.0
        self.read_back: list[ReadBack] = []
        self.samples: list[TraceSample] = []
        self.pacing = pacing(to_make, context.session.study.touch)
        self._next_step_s = self._step_s

    def deliver(self, start: Setpoint) -> None:
        """Soft start, the touch itself with its ramp and sweep; the output stays on."""
        context, to_make = self._context, self._touch
        update_view(context, device=context.device.drive(start))
        wait(context, start.voltage_v / start.ramp_v_per_s)
        context.participant.show(self.pacing)
        self._look()
        if self._ramps:
            self._move_on(0.0)
        self._began_s = context.clock.monotonic_s()
        wait(context, self.pacing.duration_s, self._meanwhile, min(TICK_S, self._step_s))
        if to_make.sweep_to is not None:
            self._move_on(1.0)
        self._look()

    def _look(self) -> None:
        update_view(self._context, device=self._sampled(keep=True))

    def _sampled(self, *, keep: bool) -> ReadBack:
        """Read the drive and the finger; a drive that stays as it was need not be kept."""
        read_back = self._context.device.read_back()
        if keep:
            self.read_back.append(read_back)
        self.samples += samples_of(read_back)
        return read_back

    @property
    def _step_s(self) -> float:
        return min(SWEEP_STEP_S, max(self.pacing.duration_s / SWEEP_STEPS, FASTEST_STEP_S))

    @property
    def _ramps(self) -> bool:
        return self._touch.end_voltage_v != self._touch.voltage_v

    def _meanwhile(self) -> None:
        """Look at the finger now and then; move the frequency on if it sweeps."""
        passed_s = self._context.clock.monotonic_s() - self._began_s
        sweeps = self._touch.sweep_to is not None
        if passed_s >= self._next_sample_s:
            self._next_sample_s += SAMPLE_EVERY_S
            self._sampled(keep=sweeps or self._ramps)
        if sweeps and passed_s >= self._next_step_s:
            self._next_step_s += self._step_s
            self._move_on(min(passed_s / self.pacing.duration_s, 1.0))

    def _move_on(self, share: float) -> None:
        """Go to this share of the sweep; the amplitude goes on towards the end of its ramp."""
        to_make = self._touch
        frequency = to_make.frequency + share * (to_make.end_frequency - to_make.frequency)
        change_v = abs(to_make.end_voltage_v - to_make.voltage_v)
        towards = _setpoint(self._context, to_make.end_voltage_v, frequency)
        if self._ramps:
            slope = max(change_v / self.pacing.duration_s, SLOWEST_RAMP_V_PER_S)
            towards = replace(towards, ramp_v_per_s=min(slope, towards.ramp_v_per_s))
        self._context.device.drive(towards)


def _setpoint(context: SessionContext, voltage_v: float, frequency: float) -> Setpoint:
    return Setpoint(
        voltage_v=voltage_v,
        frequency_hz=frequency * context.resonance_hz,
        ramp_v_per_s=context.session.study.rig.ramp_v_per_s,
    )


def _warning(verdict: Compliance) -> str:
    judged_parts = {"force": verdict.force_ok, "place": verdict.place_ok}
    missed = [name for name, is_ok in judged_parts.items() if is_ok is False]
    return f"the touch was not as asked: {' and '.join(missed)}" if missed else ""


def ask(context: SessionContext, trial: Trial, judged: Sequence[Compliance]) -> Answered:
    """Ask what `trial` has to ask and return it as the journal holds it.

    Args:
        context: of the session.
        trial: whose touches are made.
        judged: how each of them was.
    """
    change, score, given = _answers(context, trial)
    return Answered(
        index=trial.index,
        kind=trial.kind,
        condition=trial.condition,
        change=change,
        agrees=None if change is None else change == trial.expected,
        score=score,
        level=trial.level,
        opposite=trial.opposite,
        reaction_time_s=tuple(entry.reaction_time_s for entry in given),
        traces=tuple(entry.trace for entry in given),
        judged=tuple(judged),
    )


def _answers(
    context: SessionContext, trial: Trial
) -> tuple[str | None, int | None, list[Response]]:
    """Return what changed, its score, and how both were given.

    The score is missing where the answer disagrees with the expectation and the study asks only
    for scores of effects that agree (the paper's rule, section 5.2).
    """
    if trial.question is None:
        context.participant.show(Instruction(text="remember"))
        return None, None, [response(context)]
    rating = context.session.study.rating
    context.participant.show(AskChange(question=trial.question))
    change = response(context)
    checked_answer(trial.question, change.answer)
    agrees = change.answer == trial.expected
    if not trial.scored or not (agrees or rating.score_when == "always"):
        return change.answer, None, [change]
    context.participant.show(AskScore(rating=rating))
    score = response(context)
    return change.answer, rating.checked_score(int(score.answer)), [change, score]
