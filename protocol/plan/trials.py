"""Records of a plan: its trials, the beams they need and their durations."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Literal

from protocol.journal.records import PlannedTrack, PlannedTrial
from protocol.study.study import Study
from protocol.study.study_question import Question
from protocol.study.touch import Touch, on_s

TrialKind = Literal["baseline", "signal", "practice", "trial", "catch", "track", "pass"]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One trial: touches, then a question unless `question` is None, then a score if `scored`.

    Of a condition without a question the score is asked at once, also in its catch trials, which
    are not `scored`: it is compared, and no score of the condition.

    `index` counts from 0 within a session; `block` is 0 before the first block. The touches are
    final: `level` is the factor already applied to the condition's amplitudes (0 in a catch
    trial), and `opposite` says that they are already in the opposite order. A break of at least
    `break_s` precedes the trial. The touches of a `track` are standard and comparison as the study
    file has them: the level is chosen when the trial begins.
    """

    index: int = 0
    block: int = 0
    kind: TrialKind
    condition: str | None = None
    question: Question | None = None
    expected: str | None = None
    scored: bool = False
    touches: tuple[Touch, ...]
    level: float = 1.0
    opposite: bool = False
    break_s: float = 0.0
    track: PlannedTrack | None = None

    @property
    def rated(self) -> bool:
        """Whether what is felt is scored at once, without a question about a change."""
        return self.question is None and self.kind in {"practice", "trial", "catch"}


def planned_trial(trial: Trial) -> PlannedTrial:
    """Return the record of a trial that the journal keeps."""
    # As a study file has it: what a touch does not give is left out.
    touches = tuple(touch.model_dump(exclude_none=True) for touch in trial.touches)
    return PlannedTrial(**{**vars(trial), "touches": touches})


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The trials of one session, and the order of its conditions."""

    slot: int
    sequence: tuple[str, ...]
    trials: tuple[Trial, ...]
    session: int = 1
    group: str | None = None


FEEDBACK_S = 1.0
"""How long participants read whether they were right, in tracks that say so."""
Beams = tuple[str | None, ...]


def beams_of(touches: Iterable[Touch], mounted: str | None) -> Beams:
    """Return the beams that the touches need, in order, without immediate repetition.

    `mounted` is the study's own beam, used for touches that name none.
    """
    return tuple(beam for beam, _ in groupby(touch.beam or mounted for touch in touches))


def swap_count(beams: Iterable[str | None]) -> int:
    """Return how often one beam is replaced by another.

    >>> swap_count(["1 mm", "1 mm", "none", "1 mm"])
    2
    """
    return sum(before != after for before, after in pairwise(beams))


def touches_s(study: Study, touches: Sequence[Touch]) -> float:
    """Return the duration of a trial's touches, with instructions, tares and pauses, s."""
    device_s, timing = sum(on_s(touch, study.touch, study.rig) for touch in touches), study.timing
    before_s = len(touches) * (timing.reading_s + study.force_channel.tare_s)
    return device_s + before_s + (len(touches) - 1) * timing.between_touches_s


def trial_s(study: Study, trial: Trial) -> float:
    """Return the expected duration of a trial and the pause before it, without beam swaps, s."""
    timing = study.timing
    asked = bool(trial.question or trial.track)
    asked_s = timing.answer_s * asked + timing.score_s * (trial.scored or trial.rated)
    if trial.track is not None and study.track_of(trial.track.name).feedback:
        asked_s += FEEDBACK_S
    asked_s += timing.answer_s * len(study.questions_after(trial.condition))
    return trial.break_s + timing.inter_trial_s + touches_s(study, trial.touches) + asked_s


def plan_swaps(study: Study, plan: Plan) -> int:
    """Return how often the operator swaps beams, starting with the study's own beam mounted."""
    return swaps(study, plan.trials, study.touch.beam)


def session_s(study: Study, plan: Plan) -> float:
    """Return the expected duration of a session, s."""
    blocks = max((trial.block for trial in plan.trials), default=0)
    asked_s = between_trials_s(study, plan.session, blocks)
    return remaining_s(study, plan.trials, study.touch.beam) + asked_s


def remaining_s(study: Study, trials: Sequence[Trial], mounted: str | None) -> float:
    """Return how long `trials` take with breaks and swaps from the beam `mounted`, s."""
    swaps_s = swaps(study, trials, mounted) * study.timing.beam_swap_s
    return sum(trial_s(study, trial) for trial in trials) + swaps_s


def swaps(study: Study, trials: Iterable[Trial], mounted: str | None) -> int:
    """Return how often the operator swaps beams for these trials, the first of them included."""
    touches = [touch for trial in trials for touch in trial.touches]
    return swap_count((mounted, *beams_of(touches, study.touch.beam)))


def between_trials_s(study: Study, session: int, blocks: int) -> float:
    """Return how long pages, and questions before, between and after blocks, take, s."""
    once = len(study.questions("before", session)) + len(study.questions("after", session))
    asked_s = study.timing.answer_s * (once + blocks * len(study.questions("block")))
    introduced = [study.pages("block", block) for block in range(1, blocks + 1)]
    pages = sum(map(len, [study.pages("session"), study.pages("practice"), *introduced]))
    pages += study.design.practice_trials > 0  # the text that says that practice begins
    return asked_s + study.timing.reading_s * pages
