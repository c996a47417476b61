"""Registering a study: when it may be, what it seeds, and what refuses a broken lock."""

import json
import os
import re
import shlex
import sqlite3
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from random import Random
from string import printable

import pytest
from typer import Exit

import touchbeam
from protocol.errors import BadInput
from protocol.journal.events import SessionOpened, StudyAmended, StudyRegistered
from protocol.plan.plan import plan
from protocol.registration.registration import FOLLOWS, NOTICED, locked, registration_in
from protocol.study_file.loading import parsed_study, text_digest
from runner.study.calibration import fitted_calibration, keep_fit
from runner.study.folder import StudyFolder
from runner.study.registered import registration_of
from tests.runner.command_line import everything, typed
from tests.runner.registered_study import (
    events_of,
    registered_in,
    run_session,
    study_in,
)
from tests.runner.study.test_calibration import FITTED, SLID
from tests.runner.study.test_pictures import PAGE, png
from touchbeam.cli.journal import verify


def opened(place: Path, chain: str = "P01/1") -> SessionOpened:
    record = events_of(place, chain)[0].record
    assert isinstance(record, SessionOpened)
    return record


def digest_of(place: Path) -> str:
    found = registration_of(place)
    assert found is not None
    return found.digest


def refused(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    """Return the single line with which a command is refused."""
    capsys.readouterr()
    assert typed(*arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_a_registration_is_written_and_journalled(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path)
    asked = ("--hypothesis", "voltage above structure", "--hypothesis", "conditions differ")
    assert typed("register", tmp_path, *asked, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    text = (tmp_path / "registration.toml").read_text(encoding="utf-8")
    found = registration_in(text)
    assert told["digest"] == found.digest
    assert found.hypotheses == ("conditions differ", "voltage above structure")
    assert found.participants == 9
    assert found.study_sha256 == text_digest(StudyFolder(path=tmp_path).text())
    assert f"Registration, which seeds the orders: SHA-256 {found.digest}\n" in told["text"]
    assert everything(tmp_path) == {"study.toml", "study.db", "registration.toml"}
    (event,) = events_of(tmp_path, "@study")
    assert event.record == StudyRegistered(
        registration=found.digest, study_sha256=found.study_sha256, text=text
    )
    assert typed("verify", tmp_path) == 0


@pytest.mark.parametrize(
    ("change", "options", "told"),
    [
        (("participants = 9", "#"), (), "design.participants must be set in study.toml"),
        (("seed = 1", "seed = 2"), ("--primary", "voltage"), "no hypothesis 'voltage'; there are"),
        (("seed = 1", "seed = -1"), (), "study.seed"),
    ],
)
def test_what_cannot_be_registered_leaves_nothing_behind(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: tuple[str, str],
    options: tuple[str, ...],
    told: str,
) -> None:
    study_in(tmp_path, "paper", change)
    assert told in refused(capsys, "register", tmp_path, *options)
    assert everything(tmp_path) == {"study.toml"}


@pytest.mark.parametrize(
    ("template", "changes", "name", "why"),
    [
        ("plate", (), NOTICED, "nobody is asked about a change"),
        ("plate", (r", friction = 0\.\d+",), FOLLOWS, "its touches state no friction"),
        ("paper", (r"catch_trials = \d+",), f"voltage {NOTICED}", "it has no catch trials"),
    ],
)
def test_a_hypothesis_that_a_study_lacks_is_refused_with_the_reason(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    template: str,
    changes: tuple[str, ...],
    name: str,
    why: str,
) -> None:
    assert typed("new", tmp_path / "study", "--template", template) == 0
    file = tmp_path / "study" / "study.toml"
    text = file.read_text(encoding="utf-8")
    for change in changes:
        text = re.sub(change, "", text)
    file.write_text(text, encoding="utf-8")
    capsys.readouterr()
    told = refused(capsys, "register", tmp_path / "study", "--primary", name)
    assert f"no hypothesis {name!r} of this study: " in told
    assert told.rstrip().endswith(why)


def test_the_digest_seeds_plans_wherever_they_are_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    registered_in(tmp_path, "extended")
    digest = digest_of(tmp_path)
    study = StudyFolder(path=tmp_path).study()
    drawn = [plan(locked(study, digest), slot) for slot in range(2)]
    assert [made.sequence for made in drawn] != [plan(study, slot).sequence for slot in range(2)]
    capsys.readouterr()
    assert typed("check", tmp_path, "--participants", "2", "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["registration"] == digest
    assert [entry["sequence"] for entry in shown["participants"]] == [
        list(made.sequence) for made in drawn
    ]
    run_session(tmp_path, "P01")
    run_session(tmp_path, "P01", kind="rehearsal")
    for chain in ("P01/1", "P01/1 (rehearsal)"):
        assert opened(tmp_path, chain).sequence == drawn[0].sequence
        assert opened(tmp_path, chain).registration == digest
    next_plan = touchbeam.load(tmp_path).plan("P02")
    scored = next_plan[next_plan.trial_kind == "trial"]
    assert scored.condition.tolist() == list(drawn[1].sequence)
    assert typed("verify", tmp_path) == 0


def test_without_a_registration_nothing_is_locked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_session(study_in(tmp_path), "P01")
    event = events_of(tmp_path, "P01/1")[0]
    assert not {"registration", "calibration"} & event.payload.keys()
    study = parsed_study(StudyFolder(path=tmp_path).text())
    assert opened(tmp_path).sequence == plan(study, 0).sequence
    assert typed("check", tmp_path, "--json") == 0
    assert "registration" not in json.loads(capsys.readouterr().out)


def test_a_registration_comes_before_the_first_session(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path)
    run_session(tmp_path, "P01", kind="rehearsal")
    assert typed("register", tmp_path) == 0, "a rehearsal does not count"
    other = study_in(tmp_path / "other")
    run_session(other, "P01")
    line = refused(capsys, "register", other)
    assert "P01/1 is recorded: a study must be registered before its first session" in line
    assert not (other / "registration.toml").exists()


def test_registering_again_changes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    registered_in(tmp_path)
    before = (tmp_path / "registration.toml").read_bytes()
    assert typed("register", tmp_path) == 0
    assert (tmp_path / "registration.toml").read_bytes() == before
    assert len(events_of(tmp_path, "@study")) == 1
    study_in(tmp_path, "paper", ("seed = 1", "seed = 2"))
    line = refused(capsys, "register", tmp_path)
    assert "and changed since: study file; take that back, or move registration.toml away" in line
    (tmp_path / "registration.toml").rename(tmp_path / "old.toml")
    assert typed("register", tmp_path) == 0
    assert len(events_of(tmp_path, "@study")) == 2
    assert (tmp_path / "registration.toml").read_bytes() != before
    run_session(tmp_path, "P01")
    assert typed("verify", tmp_path) == 0


def test_registering_again_says_how_to_repeat_other_hypotheses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path)
    assert typed("register", tmp_path, "--hypothesis", "gains differ") == 0
    line = refused(capsys, "register", tmp_path)
    assert "and changed since: secondary; repeat touchbeam register STUDY --primary" in line
    assert "--hypothesis 'gains differ', or move registration.toml away" in line


def test_a_lost_file_is_restored_from_the_journal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    registered_in(tmp_path)
    run_session(tmp_path, "P01")
    kept = (tmp_path / "registration.toml").read_bytes()
    (tmp_path / "registration.toml").unlink()
    with pytest.raises(BadInput, match=re.escape("registration.toml is missing, but the study")):
        run_session(tmp_path, "P02")
    capsys.readouterr()
    assert typed("verify", tmp_path) == 1
    assert "FAIL  registration.toml is missing" in capsys.readouterr().out
    assert typed("register", tmp_path) == 0
    assert (tmp_path / "registration.toml").read_bytes() == kept
    assert typed("verify", tmp_path) == 0
    line = refused(capsys, "register", tmp_path, "--primary", "ratings follow the prediction")
    assert "P01/1 is recorded under registration" in line


def _advised(said: str) -> list[str]:
    """Return the options of the command that restores a registration."""
    command = said.partition("restore it with: touchbeam register STUDY ")[2]
    return shlex.split(command.splitlines()[0])


def test_a_registration_says_what_it_replaces(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As one without the options of the lost one does."""
    above = ("--hypothesis", "voltage above structure")
    assert typed("register", study_in(tmp_path), *above) == 0
    assert "replaces" not in capsys.readouterr().out
    first = digest_of(tmp_path)
    (tmp_path / "registration.toml").unlink()
    assert typed("verify", tmp_path) == 1
    found = capsys.readouterr().out
    assert typed("register", tmp_path, *_advised(found)) == 0
    assert "replaces" not in capsys.readouterr().out
    assert digest_of(tmp_path) == first
    (tmp_path / "registration.toml").unlink()
    assert typed("register", tmp_path) == 0
    told = f"This replaces registration {first[:12]}, which the journal keeps; changed: secondary\n"
    assert told in capsys.readouterr().out
    (tmp_path / "registration.toml").unlink()
    assert typed("register", tmp_path, *above, "--json") == 0
    assert json.loads(capsys.readouterr().out)["replaced"].endswith("; changed: secondary")
    (tmp_path / "registration.toml").unlink()
    assert typed("register", tmp_path, *above, "--json") == 0
    assert json.loads(capsys.readouterr().out)["replaced"] == ""
    assert digest_of(tmp_path) == first


def test_a_file_edited_by_hand_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    registered_in(tmp_path)
    run_session(tmp_path, "P01")
    file = tmp_path / "registration.toml"
    file.write_text(file.read_text().replace("participants = 9", "participants = 8"))
    told = "registration.toml: was changed after touchbeam register wrote it; restore it"
    assert told in refused(capsys, "check", tmp_path)
    virtual = ("--participant", "P02", "--ratings", "virtual")
    assert told in refused(capsys, "run", tmp_path, *virtual)
    assert told in refused(capsys, "register", tmp_path)
    assert typed("verify", tmp_path, "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert not found["ok"]
    assert told in found["registration_problem"]


@pytest.mark.parametrize("command", ["check", "register", "verify"])
def test_a_pipe_in_place_of_the_file_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    folder = registered_in(tmp_path)
    (folder / "registration.toml").unlink()
    os.mkfifo(folder / "registration.toml")
    capsys.readouterr()
    assert typed(command, folder) == (1 if command == "verify" else 2)
    said = capsys.readouterr()
    assert "registration.toml: must be a file, got a pipe or a device" in said.out + said.err


def test_a_forged_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its digest is right, but the journal holds another one."""
    registered_in(tmp_path)
    other = registered_in(tmp_path / "other", "extended")
    (tmp_path / "registration.toml").write_bytes((other / "registration.toml").read_bytes())
    with pytest.raises(BadInput, match="but the journal holds registration"):
        run_session(tmp_path, "P01")
    told = "but the journal holds registration"
    assert told in refused(capsys, "check", tmp_path)
    with pytest.raises(BadInput, match=told):
        touchbeam.load(tmp_path).plan("P02")
    capsys.readouterr()
    assert typed("verify", tmp_path) == 1
    assert told in capsys.readouterr().out


def test_a_changed_calibration_is_noticed_and_a_later_one_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path)
    keep_fit(tmp_path, SLID, "BOARD", FITTED)
    assert typed("register", tmp_path) == 0
    file = tmp_path / "calibration.json"
    kept = file.read_text()
    run_session(tmp_path, "P01")
    assert typed("verify", tmp_path) == 0
    file.write_text(kept.replace("0.0042", "0.0043"))
    capsys.readouterr()
    assert typed("verify", tmp_path) == 1
    told = capsys.readouterr().out
    assert re.search(r"holds session slide/1, calibration SHA-256 \w+, but session slide/1, ", told)
    file.unlink()
    assert typed("verify", tmp_path) == 1
    assert "has no fit of the rig, but session slide/1, " in capsys.readouterr().out
    file.write_text(kept)
    keep_fit(tmp_path, SLID, "BOARD", {**FITTED, "session": "slide/2", "gain": {"value": 1.2}})
    assert typed("verify", tmp_path) == 0


def test_a_copy_without_its_journal_may_rehearse(tmp_path: Path) -> None:
    registered_in(tmp_path)
    (tmp_path / "study.db").unlink()
    run_session(tmp_path, "P01", kind="rehearsal")
    with pytest.raises(BadInput, match="the journal does not hold the registration"):
        run_session(tmp_path, "P02")
    assert typed("register", tmp_path) == 0
    run_session(tmp_path, "P02")


def test_a_session_of_another_study_file_or_registration_fails_verification(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    registered_in(tmp_path)
    run_session(tmp_path, "P01")
    _rewrite(tmp_path, "P01/1", lambda payload: payload.update(study_sha256="0" * 64))
    assert typed("verify", tmp_path) == 1
    told = "its study file does not have the digest that the journal names"
    assert told in capsys.readouterr().out
    _rewrite(tmp_path, "P01/1", lambda payload: payload.pop("registration"))
    assert typed("verify", tmp_path) == 1
    assert "it is not registered, although the study was" in capsys.readouterr().out
    _rewrite(tmp_path, "P01/1", lambda payload: payload.update(registration="0" * 64))
    assert typed("verify", tmp_path) == 1
    assert "its registration is none that the journal holds" in capsys.readouterr().out


def test_a_registration_of_another_digest_fails_verification(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    registered_in(tmp_path)
    _rewrite(tmp_path, "@study", lambda payload: payload.update(study_sha256="0" * 64))
    assert typed("verify", tmp_path) == 1
    assert "a registration in the journal does not have its digest" in capsys.readouterr().out


def _rewrite(place: Path, chain: str, change: object) -> None:
    """Change a session's first payload without its digest; a forger would make new digests."""
    from collections.abc import Callable
    from typing import Any, cast

    with sqlite3.connect(place / "study.db") as connection:
        triggers = connection.execute(
            "SELECT name, sql FROM sqlite_master WHERE type = 'trigger'"
        ).fetchall()
        for name, _ in triggers:
            connection.execute(f"DROP TRIGGER {name}")
        (stored,) = connection.execute(
            "SELECT payload FROM event WHERE session = ? AND seq = 0", (chain,)
        ).fetchone()
        payload = json.loads(stored)
        cast("Callable[[Any], object]", change)(payload)
        connection.execute(
            "UPDATE event SET payload = ? WHERE session = ? AND seq = 0",
            (json.dumps(payload), chain),
        )
        for _, sql in triggers:
            connection.execute(sql)
    connection.close()


def test_an_amendment_breaks_the_lock_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    registered_in(tmp_path)
    run_session(tmp_path, "P01")
    study_in(tmp_path, "paper", ("hold_s = 2.0", "hold_s = 3.0"))
    with pytest.raises(BadInput, match=re.escape("study.toml has changed since the last session")):
        run_session(tmp_path, "P02")
    capsys.readouterr()
    assert typed("amend", tmp_path, "--reason", "too short") == 0
    digest = digest_of(tmp_path)
    told = capsys.readouterr().out
    assert re.search(rf"breaks the lock of registration {digest[:12]} as of \d{{4}}-", told)
    amended = events_of(tmp_path, "@study")[-1].record
    assert isinstance(amended, StudyAmended)
    assert amended.breaks == digest
    run_session(tmp_path, "P02")
    assert opened(tmp_path, "P02/1").registration == digest, "orders still follow from it"
    assert typed("verify", tmp_path) == 0


def test_a_session_names_the_calibration_in_force(tmp_path: Path) -> None:
    registered_in(tmp_path)
    run_session(tmp_path, "P01")
    keep_fit(tmp_path, SLID, "BOARD", FITTED)
    assert typed("verify", tmp_path) == 0, "reports list it as a deviation"
    run_session(tmp_path, "P02")
    assert opened(tmp_path).calibration is None
    named = opened(tmp_path, "P02/1").calibration
    assert named is not None
    study = parsed_study(StudyFolder(path=tmp_path).text())
    assert vars(named) == fitted_calibration(tmp_path, study).values


def _one_character_changed(content: bytes, random: Random) -> bytes:
    """Return `content` with a character replaced, inserted or removed anywhere.

    Line ends are one thing in every form, so that none is made of a carriage return.
    """
    place, new = random.randrange(len(content)), random.choice(printable.replace("\r", "")).encode()
    changed = random.choice(
        [
            content[:place] + new + content[place + 1 :],
            content[:place] + new + content[place:],
            content[:place] + content[place + 1 :],
        ]
    )
    return _one_character_changed(content, random) if changed == content else changed


def test_every_changed_character_of_a_study_is_noticed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By verify: in the study file, what it names, and the registration."""
    study_in(tmp_path)
    (tmp_path / "texts").mkdir()
    english = (files("protocol") / "languages" / "en.toml").read_bytes()
    (tmp_path / "texts" / "fr.toml").write_bytes(english.replace(b"English", b"French", 1))
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "hand.png").write_bytes(png())
    with (tmp_path / "study.toml").open("a", encoding="utf-8") as study:
        study.write(PAGE.replace("en =", 'fr = "Ainsi.", en ='))
    assert typed("register", tmp_path) == 0
    run_session(tmp_path, "P01")
    assert typed("verify", tmp_path) == 0
    random, noticed = Random(1), 0
    changed = ("study.toml", "texts/fr.toml", "pictures/hand.png", "registration.toml")
    for number in range(1000):
        file = tmp_path / changed[number % len(changed)]
        kept = file.read_bytes()
        file.write_bytes(_one_character_changed(kept, random))
        capsys.readouterr()
        with suppress(Exit):  # the command itself, since to build the command line takes longest
            verify(tmp_path)
        noticed += capsys.readouterr().out.startswith("FAIL  ")
        assert noticed == number + 1, (file, kept, file.read_bytes())
        file.write_bytes(kept)
    assert typed("verify", tmp_path) == 0


def test_files_that_were_amended_are_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = registered_in(tmp_path)
    study = folder / "study.toml"
    study.write_text(study.read_text(encoding="utf-8") + "# said otherwise\n", encoding="utf-8")
    capsys.readouterr()
    assert typed("verify", folder) == 1
    assert "neither the registered nor an amended one" in capsys.readouterr().out
    assert typed("check", folder) == 0
    assert "study.toml is not the registered one: restore it." in capsys.readouterr().out
    assert typed("amend", folder, "--reason", "a comment") == 0
    assert typed("verify", folder) == 0
    capsys.readouterr()
    assert typed("check", folder) == 0
    assert "study.toml was amended after the registration." in capsys.readouterr().out
    study.unlink()
    capsys.readouterr()
    assert typed("verify", folder) == 1
    assert "study.toml is missing" in capsys.readouterr().out
