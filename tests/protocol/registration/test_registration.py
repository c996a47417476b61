"""A registration as a file: it comes back as it was written, and no character can be changed."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256

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
from protocol.registration.registry_text import registry_text
from protocol.study.surface import Surface
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
    touchbeam="0.1.0",
)


def test_a_registration_comes_back_as_it_was_written() -> None:
    text = REGISTERED.text()
    assert registration_in(text) == REGISTERED
    assert registration_in(text).digest == REGISTERED.digest


@pytest.mark.parametrize(("schema", "earlier"), [(1, "0.1.0"), (2, "")])
def test_both_schemas_are_read_and_new_ones_are_of_the_second(schema: int, earlier: str) -> None:
    assert "\nschema = 2\n" in REGISTERED.text()
    body = REGISTERED.text().partition("\n")[2].replace("schema = 2", f"schema = {schema}")
    text = f'digest = "{sha256(body.encode()).hexdigest()}"\n{body}'
    found = registration_in(text)
    assert (found.schema, found.earlier) == (schema, earlier)
    assert found.text() == replace(found, written="").text() == text


def test_any_text_comes_back() -> None:
    odd = replace(REGISTERED, study="\x7f „a study“\n[of]\t'\"texts\"'")
    assert registration_in(odd.text()) == odd


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
        ("schema = 2", "schema = 3"),
        ("schema = 2\n", ""),
        ("participants = 20", 'participants = "20"'),
        ("participants = 20", "participants = 20.5"),
        ("sessions = 1", "sessions = 1\nweeks = 2"),
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


def told(registered: Registration, tested: Sequence[str]) -> list[str]:
    return [*registry_text(registered, dict.fromkeys(tested, "a test"), Surface())]


def test_the_text_for_a_registry_says_what_is_settled_and_nothing_else() -> None:
    grouped = replace(REGISTERED, groups={"young": 8, "old": 12})
    assert told(grouped, grouped.hypotheses) == [
        "Study: a study",
        "Primary hypothesis: conditions differ (a test)",
        "Secondary hypothesis: voltage above structure (a test)",
        "Secondary hypotheses count as supported only if the primary one is.",
        "Participants: 20 (8 young, 12 old)",
        "Sessions of each: 1",
        "Exclusion: a trial answered sooner than 0.3 s is left out",
        "Prediction: law consistent, rung mode, calibration: session slide/1",
        f"Study file: SHA-256 {'1' * 64}",
        f"Analysis: touchbeam 0.1.0, settings with SHA-256 {REGISTERED.analysis_sha256}",
        f"Registration, which seeds the orders: SHA-256 {grouped.digest}",
    ]


def test_a_registration_of_little_has_a_short_text() -> None:
    """Also of a hypothesis that an amended study file no longer has."""
    little = replace(REGISTERED, secondary=(), calibration={}, exclusions=())
    assert told(little, ())[1:5] == [
        "Primary hypothesis: conditions differ",
        "Participants: 20",
        "Sessions of each: 1",
        "Prediction: law consistent, rung mode, calibration: the paper's values",
    ]
