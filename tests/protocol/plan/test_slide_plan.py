"""The plan of a sliding experiment: each pass as often as asked, and references spread evenly."""

from collections import Counter
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from protocol.plan.plan import DEFAULT_RATE_HZ, slide_plan, slide_study
from protocol.plan.trials import Plan, Trial
from protocol.proof.slide_checks import slide_plan_problems
from protocol.study.study import Study
from protocol.study.touch import Direction, Slide, SlidePass
from tests.protocol.studies import small

DIRECTIONS: list[tuple[Direction, ...]] = [("right",), ("left",), ("right", "left")]
SLIDES = st.builds(
    Slide,
    frequencies=st.lists(st.sampled_from([0.97, 0.98, 0.99, 1.0]), min_size=1, unique=True),
    frequencies_hz=st.sampled_from([(), (23_200.0,), (23_200.0, 24_000.0)]),
    references=st.integers(0, 4),
    repeats=st.integers(1, 3),
    directions=st.sampled_from(DIRECTIONS),
    speeds_m_s=st.sampled_from([(0.005,), (0.004, 0.01)]),
    paths_m=st.sampled_from([((0.010, 0.081),), ((0.010, 0.020), (0.030, 0.060))]),
)


def study_of(slide: Slide, seed: int = 1) -> Study:
    study = small(2)
    header = study.study.model_copy(update={"seed": seed})
    return slide_study(study.model_copy(update={"slide": slide, "study": header}))


def driven(plan: Plan) -> list[Trial]:
    return [trial for trial in plan.trials if trial.touches[0].voltage_v > 0]


def of_pass(trial: Trial) -> tuple[object, ...]:
    (made,) = trial.touches
    assert isinstance(made, SlidePass)
    return (made.frequency_hz or made.frequency, made.path_m, made.duration_s, made.direction)


@given(slide=SLIDES, seed=st.integers(0, 1000))
def test_every_pass_is_made_as_often_as_asked(slide: Slide, seed: int) -> None:
    plan = slide_plan(study_of(slide, seed))
    assert len(plan.trials) == slide.passes
    assert [trial.index for trial in plan.trials] == list(range(slide.passes))
    drives = len(slide.frequencies) + len(slide.frequencies_hz)
    ways = len(slide.paths_m) * len(slide.speeds_m_s) * len(slide.directions)
    counts = Counter(map(of_pass, driven(plan)))
    assert set(counts.values()) == {slide.repeats}
    assert len(counts) == drives * ways
    names = {trial.condition for trial in driven(plan)}
    assert len(names) == len(counts), "a name tells a pass from every other one"


@given(slide=SLIDES, seed=st.integers(0, 1000))
def test_all_come_once_before_one_comes_again(slide: Slide, seed: int) -> None:
    order = [of_pass(trial) for trial in driven(slide_plan(study_of(slide, seed)))]
    size = len(order) // slide.repeats
    for first in range(0, len(order), size):
        assert len(set(order[first : first + size])) == size


@given(slide=SLIDES, seed=st.integers(0, 1000))
def test_references_stand_from_first_to_last(slide: Slide, seed: int) -> None:
    plan = slide_plan(study_of(slide, seed))
    ways = len(slide.paths_m) * len(slide.speeds_m_s) * len(slide.directions)
    at = [trial.index for trial in plan.trials if trial.touches[0].voltage_v == 0]
    assert len(at) == ways * slide.references
    rounds = [at[first : first + ways] for first in range(0, len(at), ways)]
    if rounds:
        assert rounds[0][0] == 0
    if len(rounds) > 1:
        assert rounds[-1][-1] == slide.passes - 1
        gaps = [after[0] - before[0] for before, after in pairwise(rounds)]
        assert max(gaps) - min(gaps) <= 1, "evenly"


def test_the_seed_and_the_session_decide_the_order_alone() -> None:
    slide = Slide(repeats=2)
    assert slide_plan(study_of(slide)) == slide_plan(study_of(slide))
    orders = {
        tuple(trial.condition for trial in slide_plan(study_of(slide, seed), session).trials)
        for seed in (1, 2, 3)
        for session in (1, 2)
    }
    assert len(orders) == 6


@given(slide=SLIDES)
def test_every_plan_is_proved(slide: Slide) -> None:
    study = study_of(slide)
    assert slide_plan_problems(study, slide_plan(study, session=2)) == []


def test_a_sliding_study_asks_nobody_and_records() -> None:
    study = study_of(Slide())
    assert study.conditions == () == study.question
    assert study.force_channel.rate_hz == DEFAULT_RATE_HZ
    assert (study.touch.force_n, study.touch.path_m) == (0.56, (0.010, 0.081))
    assert slide_study(study) == study
