"""A journal with hashes that fit what somebody made of it: one clear line, no internal error."""

import shutil
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from protocol.journal.events import StoredEvent
from protocol.study_file.loading import template
from runner.journal.opening import open_journal, read_journal
from runner.session.loop import run
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.command_line import typed
from tests.runner.fakes import FakeDevice, FakeOperator, FakeParticipant, context
from tests.runner.journal.tampering import Payloads, forge

QUESTIONS = OWN_QUESTIONS.replace('["voltage", "pressure"]', '["voltage"]')
ANSWERS = {
    "pleasantness": "5",
    "confidence": "61.8",
    "sensations": "sticking;vibration",
    "hand": "left",
    "age": "31",
    "remarks": "none",
}
TEXT = (
    template("threshold")
    .replace("trials = 40 ", "trials = 2 ")
    .replace("trials = 60", "trials = 2")
    .replace("catch = 4 ", "catch = 1 ")
    .replace("easy = 4 ", "easy = 1 ")
    .replace("stop = { reversals = 12 }", "")
    + QUESTIONS
)
NOW = "P01/1"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with tracks, conditions and questions, and a session of one participant."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "study.toml").write_text(TEXT, encoding="utf-8")
    device = FakeDevice()
    with open_journal(folder / "study.db") as journal:
        person = FakeParticipant(answers=ANSWERS)
        run(context(journal, device, person, TEXT, FakeOperator(device)))
    assert typed("verify", folder) == 0
    return folder


@pytest.fixture
def study(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "study"))


def values_in(payload: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield every value of a payload, of a list the first one alone."""
    parts = enumerate(payload[:1]) if isinstance(payload, list) else ()
    for part, value in payload.items() if isinstance(payload, dict) else parts:
        yield (*path, part), value
        yield from values_in(value, (*path, part))


def with_value(payload: Any, path: tuple[Any, ...], value: object) -> Any:
    changed = deepcopy(payload)
    holder = changed
    for part in path[:-1]:
        holder = holder[part]
    holder[path[-1]] = value
    return changed


ANYTHING = ("answer", "trace", "traces", "touches", "versions")
"""Keys whose values are of any type."""


def test_no_value_of_another_type_is_taken_for_sound(whole: Path) -> None:
    """Of each kind of event, each value, in the place of which stands what it cannot be."""
    with read_journal(whole / "study.db") as journal:
        events = {event.tag: event for event in journal.events(NOW)}
    judged = 0
    for event in events.values():
        for path, value in values_in(dict(event.payload)):
            if {*path} & {*ANYTHING}:
                continue
            wrong: list[object] = [{"x": 1} if isinstance(value, list) else ["x", [1]]]
            wrong += [2**63] if type(value) is int and path != ("seed",) else []
            for other in wrong:
                forged = replace(event, payload=with_value(event.payload, path, other))
                said = StoredEvent.damage(forged)
                assert said.startswith(f"event {event.seq} is damaged: {event.tag}, "), path
                judged += 1
    assert judged > 90


FORGED: dict[str, tuple[str, tuple[Any, ...], object]] = {
    "a track": ("answered", ("track", "name"), "another one"),
    "a planned track": ("session-opened", ("trials", -1, "track", "name"), "another one"),
    "a question named as a column": ("question-answered", ("name",), "score"),
    "a question of no name": ("question-answered", ("name",), ""),
    "a group": ("session-opened", ("group",), 3),
    "a seed": ("session-opened", ("seed",), "x"),
    "a slot": ("session-opened", ("slot",), "first"),
    "a larger slot": ("session-opened", ("slot",), 2**63),
    "a block": ("session-opened", ("trials", -1, "block"), 10**60),
    "a condition": ("answered", ("condition",), "none of it"),
    "a kind": ("trial-started", ("kind",), "catch"),
    "a trial": ("trial-started", ("index",), 999),
    "a touch": ("touch-started", ("touch",), 7),
    "a resonance": ("resonance-measured", ("frequency_hz",), 0.0),
    "a read-back": ("touch-ended", ("read_back", 0, "voltage_v"), "much"),
    "a sample": ("touch-ended", ("trace", 0), [1.0, True, 0.0]),
    "a participant": ("session-opened", ("participant",), "P07"),
    "a session": ("session-opened", ("session",), 2),
    "what nobody was": ("session-opened", ("kind",), "slide"),
}


def forged(study: Path, tag: str, path: tuple[Any, ...], value: object) -> None:
    with read_journal(study / "study.db") as journal:
        tags = [event.tag for event in journal.events(NOW)]
    at = max(number for number, each in enumerate(tags) if each == tag)

    def change(payloads: Payloads) -> None:
        payloads[at] = with_value(payloads[at], path, value)

    forge(study / "study.db", NOW, change)


COMMANDS: dict[str, Callable[[Path], tuple[str | Path, ...]]] = {
    "status": lambda study: ("status", study),
    "report": lambda study: ("report", study, "--sections", "trials"),
    "csv": lambda study: ("export", study, study / "out", "--format", "csv"),
    "bids": lambda study: ("export", study, study / "out", "--format", "bids"),
}


@pytest.mark.parametrize("what", FORGED)
def test_what_was_forged_with_hashes_that_fit_is_told_in_one_line(
    study: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    forged(study, *FORGED[what])
    assert typed("verify", study) == 1
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("FAIL")]
    assert len(said) == 1
    assert "chain unbroken; event" in said[0] or "; its events do not fit together" in said[0]
    for name, command in COMMANDS.items():
        code, told = typed(*command(study)), capsys.readouterr().err
        # Only `verify` asks whether the level of a track follows from the answers before it.
        if what != "a planned track":
            assert code == 1, name
            assert told.startswith("touchbeam: session P01/1 cannot be read (event "), name
            assert told.count("\n") == 1
        assert "internal error" not in told


def test_chains_whose_names_were_swapped_are_found(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The payload names the other person, although every hash fits."""
    forge(study / "study.db", NOW, lambda _: None, name="P03/1")
    assert typed("verify", study) == 1
    assert "it opens another session, 'P01/1 (participant)'" in capsys.readouterr().out
    assert typed("report", study) == 1
    assert "session P03/1 cannot be read (event 0 is damaged" in capsys.readouterr().err


def test_a_rehearsal_that_was_made_a_session_is_found(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forge(study / "study.db", NOW, lambda _: None, name="P01/1 (rehearsal)")
    assert typed("verify", study) == 1
    assert "it opens another session" in capsys.readouterr().out
