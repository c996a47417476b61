"""What is private stays behind in the formats of export that are made to be shared."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from protocol.journal.events import (
    Answered,
    Event,
    NoteTaken,
    RigDescribed,
    SessionOpened,
    TrialAborted,
    TrialStarted,
    WatchdogTested,
    WindowChanged,
)
from protocol.journal.records import QuestionAnswer
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template, text_digest
from runner.journal.opening import open_journal
from tests.analysis.chains import chain
from tests.analysis.reports import session_events
from tests.runner.command_line import typed

TEXT = template("extended") + (
    '\n[[question]]\nname = "effort"\nkind = "number"\nwhen = "trial"\n'
    'required = false\n[question.text]\nen = "How hard was it?"\nzh = "难吗？"\n'
)
SECRETS = ("C-17-Smith", "sneezed twice", "/dev/ttyUSB7", "mouse-path", "2026-01-01")


def eventful(study: Study, slot: int, rng: np.random.Generator, name: str) -> Iterator[Event]:
    """A session with all that stays behind, and with an attempt that was broken off."""
    for event in session_events(study, slot, rng, who=name):
        if isinstance(event, SessionOpened):
            yield replace(
                event, study_text=TEXT, study_sha256=text_digest(TEXT), consent="C-17-Smith"
            )
        elif isinstance(event, TrialStarted) and event.index == 4:
            yield event
            yield TrialAborted(index=4, why="the operator repeats it")
            yield NoteTaken(text="sneezed twice")
            yield event
        elif isinstance(event, Answered):
            effort = QuestionAnswer(
                name="effort", answer=event.index, reaction_time_s=0.5, trace={"mouse-path": [1]}
            )
            yield replace(event, traces=({"mouse-path": [1, 2]},), questions=(effort,))
        else:
            yield event
            if event.TAG == "device-armed":
                yield WatchdogTested(tripped=True, idn="test", address="/dev/ttyUSB7")
                yield RigDescribed(answers={"skin state": "dry"})
                yield WindowChanged(has_keys=False, is_shown=False)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("private") / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(TEXT, encoding="utf-8")
    parsed, rng = parsed_study(TEXT), np.random.default_rng(1)
    with open_journal(folder / "study.db") as journal, journal.alone():
        for slot, name in enumerate(("P03", "P01")):
            for stored in chain([*eventful(parsed, slot, rng, name)]):
                journal.append(f"{name}/1", stored)
    return folder


@pytest.mark.parametrize("form", ["bids", "psychds"])
def test_what_is_private_stays_behind(form: str, study: Path, tmp_path: Path) -> None:
    journal = (study / "study.db").read_bytes()
    assert all(secret.encode() in journal for secret in SECRETS)
    assert typed("export", study, tmp_path / "shared", "--format", form) == 0
    files = [path for path in (tmp_path / "shared").rglob("*") if path.is_file()]
    assert any("the operator repeats it" in path.read_text(encoding="utf-8") for path in files)
    for file in files:
        assert not [secret for secret in SECRETS if secret.encode() in file.read_bytes()], file


def test_the_study_file_and_the_journal_stay_behind(study: Path, tmp_path: Path) -> None:
    assert typed("export", study, tmp_path / "bids", "--format", "bids") == 0
    assert sorted(path.name for path in (tmp_path / "bids").iterdir()) == [
        "README.md",
        "dataset_description.json",
        "participants.json",
        "participants.tsv",
        "sub-P01",
        "sub-P03",
    ]
