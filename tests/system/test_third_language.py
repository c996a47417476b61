"""A third language is one new file: for every study beside the built-in ones, or in a study."""

import json
import re
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from protocol.study import languages
from tests.runner.command_line import typed

FILES = Path(languages.__file__).parents[1] / "languages"
FRENCH = (
    (FILES / "en.toml")
    .read_text(encoding="utf-8")
    .replace('name = "English"', 'name = "French"')
    .replace('"very weak" = "very weak"', '"very weak" = "très faible"')
    .replace("Touch now.", "Touchez.")
)
VIRTUAL = ("--ratings", "virtual")
RUN = ("run", "study", "--participant", "P01", "--language", "fr", "--ratings")


@pytest.fixture(autouse=True)
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    typed("new", "study")
    return tmp_path / "study"


@pytest.fixture(params=["for every study", "in the study"])
def french(
    request: pytest.FixtureRequest, study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Path]:
    """The file of a third language, in either place."""
    place = study / "texts"
    if request.param == "for every study":
        place = tmp_path / "built-in"
        shutil.copytree(FILES, place)
        monkeypatch.setattr(languages, "FOLDER", place)
    place.mkdir(exist_ok=True)
    (place / "fr.toml").write_text(FRENCH, encoding="utf-8")
    _forget()
    yield place / "fr.toml"
    _forget()


def _forget() -> None:
    languages.built_in.cache_clear()
    languages.built_in_codes.cache_clear()


def opened(study: Path) -> Any:
    with closing(sqlite3.connect(study / "study.db")) as journal:
        rows = journal.execute("SELECT payload FROM event WHERE tag = 'session-opened'").fetchall()
    return [json.loads(body) for (body,) in rows]


def test_a_third_language_is_checked_and_rehearsed(
    study: Path, french: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("check", "study") == 0
    assert typed(*RUN, "virtual") == 0
    (session,) = opened(study)
    assert session["language"] == "fr"
    assert typed("export", "study", "data", "--format", "csv", "--rehearsals") == 0
    described = json.loads(Path("data/trials.json").read_text(encoding="utf-8"))
    assert described["language"]["levels"] == {"en": "English", "fr": "French", "zh": "Chinese"}
    assert typed("verify", "study") == 0
    assert typed("report", "study", "--rehearsals") == 0


@pytest.mark.waits
def test_a_participant_reads_the_third_language(
    study: Path, french: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The session is in real time.
    monkeypatch.setattr("device.resonance._POINTS", 7)
    text = (study / "study.toml").read_text(encoding="utf-8")
    text = text.replace("hold_s = 2.0", "hold_s = 2.0\nlead_in_s = 0.3")
    (study / "study.toml").write_text(text, encoding="utf-8")
    lines = Path("lines")
    lines.write_text("\n" * 3, encoding="utf-8")
    with lines.open(encoding="utf-8") as typist:
        monkeypatch.setattr("sys.stdin", typist)
        assert typed(*RUN, "console", "--rehearsal") == 1
    assert "Touchez. (2 s)" in capsys.readouterr().out


def test_the_journal_keeps_a_language_of_the_studys_own(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("run", "study", "--participant", "P01", "--ratings", "virtual") == 0
    (study / "texts").mkdir()
    own = study / "texts" / "fr.toml"
    own.write_text(FRENCH, encoding="utf-8")
    assert typed(*RUN[:3], "P02", *RUN[4:], "virtual") == 0
    assert "study.toml has changed since the last rehearsal." in capsys.readouterr().out
    before, after = opened(study)
    assert before["study_text"] == (study / "study.toml").read_text(encoding="utf-8")
    assert after["study_text"].startswith(before["study_text"])
    assert "Touchez." in after["study_text"]
    assert before["study_sha256"] != after["study_sha256"]


def test_mistakes_in_a_language_are_listed_with_the_studys_own(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (study / "texts").mkdir()
    own = study / "texts" / "fr.toml"
    own.write_text(FRENCH.replace("Touchez.", "Touchez! " * 50), encoding="utf-8")
    text = (study / "study.toml").read_text(encoding="utf-8")
    (study / "study.toml").write_text(text.replace("ramp_to_v = 200", "ramp_to_v = 201"), "utf-8")
    assert typed("check", "study", "--json") == 2
    shown = capsys.readouterr()
    found = [(p["line"], p.get("file")) for p in json.loads(shown.out)["problems"]]
    assert found == [(79, None), (32, "texts/fr.toml")]
    assert 'study/texts/fr.toml:32: texts."touch.now": a text must fit its place' in shown.err


def test_a_language_begins_with_the_texts_that_are_built_in(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (study / "study.toml").read_text(encoding="utf-8")
    table = '[session]\nlanguages = ["en", "fr"]\n\n[rating]'
    (study / "study.toml").write_text(text.replace("[rating]", table), encoding="utf-8")
    assert typed("check", "study") == 2
    told = capsys.readouterr().err
    assert "got 'fr'; touchbeam translate begins the file of another language" in told
    assert typed("translate", "study", "fr") == 0
    assert "Translate study/texts/fr.toml." in capsys.readouterr().out
    own = study / "texts" / "fr.toml"
    assert own.read_bytes() == (FILES / "en.toml").read_bytes()
    own.write_text(FRENCH, encoding="utf-8")
    assert typed("check", "study") == 0
    assert re.search(
        r"Language +fr: \d+ texts as in English: welcome, touch\.smooth, touch\.smooth\.harder, …",
        capsys.readouterr().out,
    )
    assert typed("translate", "study", "zh") == 0
    assert (study / "texts" / "zh.toml").read_bytes() == (FILES / "zh.toml").read_bytes()


@pytest.mark.parametrize(
    ("where", "code", "message"),
    [
        ("study", "fr", "study/texts/fr.toml: is there already; edit it, or move it away"),
        ("study", "../fr", "a language is named by its code, such as fr or pt-BR, got '../fr'"),
        ("elsewhere", "fr", "elsewhere: no study here"),
    ],
)
def test_a_language_is_begun_once_and_in_a_study(
    study: Path, capsys: pytest.CaptureFixture[str], where: str, code: str, message: str
) -> None:
    (study / "texts").mkdir()
    (study / "texts" / "fr.toml").write_text(FRENCH, encoding="utf-8")
    assert typed("translate", where, code) == 2
    assert message in capsys.readouterr().err
    assert (study / "texts" / "fr.toml").read_text(encoding="utf-8") == FRENCH
    assert [file.name for file in study.parent.iterdir()] == ["study"]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("FR.toml", FRENCH.encode(), "texts/FR.toml: must be named by a language code"),
        ("french.toml", FRENCH.encode(), "texts/french.toml: must be named by a language"),
        ("fr.toml", b"name = '\xff'", "texts/fr.toml: cannot be read"),
    ],
)
def test_a_file_that_is_no_language_is_refused(
    study: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes, message: str
) -> None:
    (study / "texts").mkdir()
    (study / "texts" / name).write_bytes(content)
    assert typed("check", "study") == 2
    assert message in capsys.readouterr().err


def test_a_language_that_is_not_there_is_refused_with_those_that_are(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed(*RUN, "virtual") == 2
    told = capsys.readouterr().err
    assert "--language must be one of en, zh, got 'fr'; touchbeam translate begins" in told
    assert not (study / "study.db").exists()


def test_a_study_that_lacks_a_name_in_a_language_cannot_be_run_in_it(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (study / "study.toml").read_text(encoding="utf-8")
    text = text.replace('en = "no effect", zh = "无效果"', 'en = "none"')
    text = text.replace("[rating]", '[session]\nlanguages = ["en"]\n\n[rating]')
    (study / "study.toml").write_text(text, encoding="utf-8")
    assert typed("check", "study") == 0
    assert typed(*RUN[:5], "zh", "--ratings", "virtual") == 2
    assert "--language zh: this study lacks a name of the scores 0 in it" in capsys.readouterr().err


def test_a_study_names_the_language_that_participants_read(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (study / "study.toml").read_text(encoding="utf-8")
    named = text.replace("[rating]", '[session]\nlanguage = "zh"\n\n[rating]')
    (study / "study.toml").write_text(named, encoding="utf-8")
    assert typed(*RUN[:4], "--ratings", "virtual") == 0
    assert typed("run", "study", "--participant", "P02", "--language", "en", *VIRTUAL) == 0
    assert [session["language"] for session in opened(study)] == ["zh", "en"]
    (study / "study.toml").write_text(named.replace('"zh"\n', '"de"\n'), encoding="utf-8")
    assert typed("check", "study") == 2
    assert "session.language: must be one of 'en' or 'zh', got 'de'" in capsys.readouterr().err
