"""A registration as a file: it comes back as it was written, and no character can be changed."""

import re
from collections import Counter
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import get_args

import pytest

from protocol.errors import BadInput
from protocol.plan.plan import plan, slide_plan, slide_study
from protocol.proof.trial_checks import cohort_problems
from protocol.registration.registration import (
    Registration,
    locked,
    registration_in,
    require_known,
)
from protocol.registration.registry_text import _ORDERS, registry_text
from protocol.study.rules import Order
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template

PAPER = parsed_study(template("paper"))
EXTENDED = parsed_study(template("extended"))
REGISTERED = Registration(
    study="a study",
    study_sha256="1" * 64,
    primary="conditions differ",
    secondary=("voltage above structure",),
    law="consistent",
    rung="mode",
    calibration={"damping_ratio": 0.0071, "gain": 1.02, "origin": "session slide/1"},
    participants=20,
    sessions=1,
    exclusions=("a trial answered sooner than 0.3 s is left out",),
    analysis={"significance level": 0.05, "correction": "Holm"},
    power={"answer": "80 % for \x7f „voltage above structure“\nwith 20 participants"},
    touchbeam="0.1.0",
)


def told(study: Study, registered: Registration) -> str:
    return registry_text(study, registered, dict.fromkeys(registered.hypotheses, "a test"))


def test_a_registration_comes_back_as_it_was_written() -> None:
    text = REGISTERED.text()
    assert registration_in(text) == REGISTERED
    assert registration_in(text).digest == REGISTERED.digest


def test_the_digest_is_that_of_everything_below_its_line() -> None:
    first, _, body = REGISTERED.text().partition("\n")
    assert first == f'digest = "{sha256(body.encode()).hexdigest()}"'


def test_the_digest_of_a_file_stays_when_a_later_version_reads_it() -> None:
    body = REGISTERED.text().partition("\n")[2] + "\n[unheard_of]\nkey = 1\n"
    text = f'digest = "{sha256(body.encode()).hexdigest()}"\n{body}'
    read = registration_in(text)
    assert read.text() == text
    assert read.digest == sha256(body.encode()).hexdigest()


def test_every_changed_character_is_noticed() -> None:
    text = REGISTERED.text()
    for place in range(len(text)):
        for other in ("x" if text[place] != "x" else "y", ""):
            with pytest.raises(BadInput, match="was changed after touchbeam register wrote it"):
                registration_in(text[:place] + other + text[place + 1 :])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("schema = 1", "schema = 2"),
        ("schema = 1\n", ""),
        ("participants = 20", 'participants = "20"'),
        ("participants = 20", "participants = 20.5"),
        ("sessions = 1", "sessions = 1\nweeks = 2"),
        ("\n[power]", "power = 1\n[powers]"),
        ('law = "', 'law = 1 # "'),
        ("[stopping]", "[stopping"),
    ],
)
def test_a_file_of_another_form_is_refused(old: str, new: str) -> None:
    """As a later version may write, or a forger whose digest is right."""
    body = REGISTERED.text().partition("\n")[2]
    assert old in body
    body = body.replace(old, new, 1)
    text = f'digest = "{sha256(body.encode()).hexdigest()}"\n{body}'
    with pytest.raises(BadInput, match="cannot be read by this version of touchbeam; use the one"):
        registration_in(text)


def test_every_setting_changes_the_digest() -> None:
    changes = [
        {"study_sha256": "2" * 64},
        {"primary": "ratings follow the prediction"},
        {"secondary": ()},
        {"law": "printed"},
        {"rung": "eq15"},
        {"calibration": {}},
        {"participants": 21},
        {"sessions": 2},
        {"exclusions": ()},
        {"analysis": {"significance level": 0.1, "correction": "Holm"}},
        {"power": {}},
        {"touchbeam": "0.2.0"},
    ]
    digests = [replace(REGISTERED, **change).digest for change in changes]  # type: ignore[arg-type]
    assert len({REGISTERED.digest, *digests}) == len(changes) + 1


def test_every_stream_changes_with_the_digest() -> None:
    first, other = (locked(EXTENDED, digit * 64) for digit in "ab")
    plans = [[plan(study, slot) for slot in range(20)] for study in (EXTENDED, first, other)]

    def drawn(what: str) -> list[object]:
        kinds = {"practice": "practice", "catch": "catch"}
        return [
            [
                (trial.index, trial.condition)
                for made in cohort
                for trial in made.trials
                if trial.kind == kinds[what]
            ]
            if what in kinds
            else [
                [(trial.condition, getattr(trial, what)) for trial in made.trials]
                for made in cohort
            ]
            for cohort in plans
        ]

    for what in ("practice", "catch", "level", "opposite", "condition"):
        before, one, two = drawn(what)
        assert before != one != two != before, what
    passes = [slide_plan(slide_study(study)).trials for study in (EXTENDED, first, other)]
    assert len({tuple(trial.condition for trial in trials) for trials in passes}) == 3


@pytest.mark.parametrize("study", [PAPER, EXTENDED], ids=["paper", "extended"])
@pytest.mark.parametrize("digit", "0a7f")
def test_registered_orders_keep_every_promise(study: object, digit: str) -> None:
    """The proof uses nothing of what drew the plan."""
    assert isinstance(study, type(PAPER))
    under = locked(study, digit * 64)
    plans = [plan(under, slot) for slot in range(2 * len(study.condition))]
    assert cohort_problems(under, plans) == []
    firsts = Counter(made.sequence[0] for made in plans)
    assert set(firsts.values()) == {2}


def test_hypotheses_are_known_by_name() -> None:
    known = ["conditions differ", "voltage above structure", "structure above voltage"]
    require_known("voltage above structure", known)
    with pytest.raises(BadInput, match=re.escape("no hypothesis 'volt'; there are 'conditions")):
        require_known("volt", known)
    many = [f"{name} above b" for name in "acdefghijklmno"]
    with pytest.raises(BadInput, match=r"; did you mean 'voltage above structure'\?$"):
        require_known("voltage above structures", [*many, *known])
    with pytest.raises(BadInput, match=r"'m above b' and 2 more$"):
        require_known("?", many)


def test_the_text_for_a_registry_names_all_that_is_settled() -> None:
    text = told(EXTENDED, REGISTERED)
    for named in (
        "Primary: conditions differ. Test: a test.",
        *("Hypotheses\n", "Sample size and stopping rule\n", "Data exclusion\n", "20 participants"),
        *REGISTERED.hypotheses,
        *REGISTERED.exclusions,
        *REGISTERED.power.values(),
        *("law consistent, rung mode", "session slide/1", "significance level: 0.05"),
        *(REGISTERED.digest, REGISTERED.study_sha256, REGISTERED.analysis_sha256),
        *EXTENDED.conditions,
    ):
        assert named in text


def test_the_text_for_a_registry_says_what_each_condition_does() -> None:
    lines = told(PAPER, REGISTERED).splitlines()
    assert (
        "  voltage: touch the place, 0 to 200 V, frequency 1, 6 s. Question about roughness, "
        "expected answer: smoother."
    ) in lines
    assert (
        "  frequency: slide to the right, 100 V, frequency 0.98; then slide to the right, 100 V, "
        "frequency 1. Question about strength, expected answer: stronger."
    ) in lines
    text = told(EXTENDED, REGISTERED)
    assert "1.5 times the force, 100 V, frequency 1." in text
    assert "beam 1.5 mm, 100 V" in text
    assert "All amplitudes times 0.25, 0.6, 1.2, 2, in random order." in text


def test_the_text_for_a_registry_names_the_questions_of_the_study() -> None:
    own = """
[[question]]
name = "confidence"
kind = "choice"
conditions = ["voltage", "pressure"]
text = { zh = "您有多确定？", en = "How sure are you?" }
labels = [{ value = "a", zh = "甲", en = "a" }, { value = "b", zh = "乙", en = "b" }]

[[question]]
name = "age"
kind = "number"
when = "before"
text = { zh = "您多大年纪？", en = "How old are you?" }
"""
    lines = told(parsed_study(template("paper") + own), REGISTERED).splitlines()
    assert "  confidence (choice, after trials of voltage, pressure): How sure are you?" in lines
    assert "  age (number, before the first trial): How old are you?" in lines


def test_the_text_for_a_registry_tells_groups_days_and_what_questions_depend_on() -> None:
    page = Path("docs/how-to/factorial.md").read_text()
    text = (
        page.partition('study.toml"\n')[2]
        .partition("```")[0]
        .replace("[design]", '[design]\nassign_groups = "by an answer"')
    )
    age = '[[question]]\nname = "age"\nkind = "number"\nwhen = "desk"\ntext = { en = "Age?" }\n'
    for name, size in (("young", "at_most = 30"), ("old", "at_least = 60")):
        when = f'name = "{name}"\nwhen = {{ question = "age", {size} }}\n'
        text = text.replace(f'name = "{name}"\n', when)
    registered = replace(REGISTERED, primary="conditions differ", secondary=())
    lines = told(parsed_study(text + age), registered).splitlines()
    assert (
        "  Groups: young, 6 participants (age is at most 30); old, 6 participants (age is at least "
        "60). They are assigned by an answer to the operator."
    ) in lines
    assert "2 sessions per participant, 20 to 72 hours between them." in " ".join(lines)
    assert "  pleasant (scale, after trials, if noticed is yes): How pleasant was it?" in lines
    assert any("0 to 50 V, frequency 23000 Hz, 3 s." in line for line in lines)


def test_the_text_for_a_registry_names_each_power() -> None:
    power = {"answer": "80 % with 20", "power of conditions differ": "0.8"}
    text = told(PAPER, replace(REGISTERED, power=power))
    assert "Sample size rationale\n  80 % with 20\n  Each test by its own p:\n" in text
    assert "  power of conditions differ: 0.8\n" in text
    assert "Sample size rationale\n  (to be filled in)\n" in told(
        PAPER, replace(REGISTERED, power={})
    )


def test_every_order_has_its_words() -> None:
    assert set(_ORDERS) == set(get_args(Order))


def test_a_study_of_tracks_registers_what_they_ask_and_what_their_thresholds_are() -> None:
    text = template("threshold")
    study = parsed_study(text[: text.index("# Scored beside")])
    first = "threshold of smallest amplitude above that of by a staircase"
    said = told(study, replace(REGISTERED, primary=first, secondary=()))
    for named in (
        "Thresholds by 2 tracks, interleaved, 1 session per participant.",
        "two intervals, quest+, 40 trials, 4 catch and 4 easy ones; which is smoother",
        "Comparison: touch the place, with the voltage of the level.",
        "Rule: 3 down 1 up, consecutive, steps 4, 4, 1 dB.",
        "It ends sooner at: reversals 12.",
        "Its threshold: 0.75 correct, curve weibull, lapse rate 0 to 0.08.",
    ):
        assert named in said
    assert "0 conditions" not in said
