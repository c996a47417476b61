"""Whatever is wrong with a study file is told as problems, and never ends a check as an error."""

import tomllib
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from random import Random
from typing import Any

import pytest

from protocol.study_file.loading import StudyError, template
from runner.study.check import validated_study
from tests.protocol.studies import OWN_QUESTIONS

PAGE = """
[[page]]
text = { en = "Read this.", zh = "请阅读。" }
"""
TEXT = """
[texts.en]
"touch.end" = "Lift your finger."
welcome = "Put {hand} {finger} on the rest."
"""
QUESTIONS = OWN_QUESTIONS.replace('["voltage", "pressure"]', '["voltage"]')
WITH_QUESTIONS = {name: template(name) + QUESTIONS for name in ("paper", "extended", "threshold")}
LEVELS = "levels = { from = 4, to = 160, count = 41,"


@pytest.mark.parametrize(
    "wrong",
    ["{ from = 4, to = 160, count = 1,", "{ from = 4,", "{ from = 0, to = 160, count = 41,"],
)
def test_a_mistake_in_the_levels_of_a_track_is_told_also_in_a_study_with_questions(
    wrong: str,
) -> None:
    text = WITH_QUESTIONS["threshold"]
    assert LEVELS in text
    with pytest.raises(StudyError) as refused:
        validated_study(text.replace(LEVELS, f"levels = {wrong}"), "study.toml")
    assert {problem.path[:3] for problem in refused.value.problems} == {("track", 0, "levels")}


@pytest.mark.parametrize(
    "text",
    ["{finger:>1000000000}", "{finger:{finger}}", "{finger!r}", "{finger.x}", "{", "{}", "}"],
)
@pytest.mark.parametrize("key", ["touch.smooth", "touch.end", "progress", "score"])
def test_a_text_has_names_in_braces_and_nothing_else_in_them(key: str, text: str) -> None:
    """Widths and the like would fill the memory with a text that somebody else wrote."""
    study = template("paper") + f'\n[texts.en]\n"{key}" = "Now {text}"\n'
    with pytest.raises(StudyError, match="the fields in braces must be") as refused:
        validated_study(study, "study.toml")
    assert {problem.path for problem in refused.value.problems} == {("texts", "en", key)}


VALUES: tuple[Any, ...] = (
    -1, 0, 1, 1e9, 0.5, float("inf"), 1e-300, "", "x", "voltage", "{finger:{finger}}", True, [],
    [1, 2, 3], ["a"], [[]], {}, {"question": "x"},
)  # fmt: skip


def places(document: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    inner = enumerate(document) if isinstance(document, list) else ()
    for part, value in document.items() if isinstance(document, dict) else inner:
        yield (*path, part)
        yield from places(value, (*path, part))


def changed(document: dict[str, Any], stream: Random) -> None:
    """Take away something of the document, or replace it."""
    *way, part = stream.choice([*places(document)])
    holder: Any = document
    for step in way:
        holder = holder[step]
    if stream.random() < 0.2:
        del holder[part]
    else:
        holder[part] = stream.choice(VALUES)


@pytest.mark.parametrize("name", ["paper", "extended", "threshold"])
@pytest.mark.parametrize("seed", range(3))
def test_no_mistake_in_a_study_file_is_an_error_of_the_check(
    monkeypatch: pytest.MonkeyPatch, name: str, seed: int
) -> None:
    whole = tomllib.loads(WITH_QUESTIONS[name] + PAGE + TEXT)
    stream = Random(f"{name} {seed}")
    for _ in range(15):
        document = deepcopy(whole)
        for _ in range(stream.choice((1, 1, 2))):
            changed(document, stream)
        read = deepcopy(document)
        # As the file would be read: to write it as TOML would be another test.
        monkeypatch.setattr("protocol.study_file.loading.whole_document", lambda _, it=read: it)
        monkeypatch.setattr("protocol.study_file.loading.located", lambda _, found: found)
        with suppress(StudyError):
            validated_study("", "study.toml")
