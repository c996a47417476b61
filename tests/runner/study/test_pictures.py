"""Pictures of a study: which files may be shown, and that a changed one is a changed study."""

import json
import re
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image

import touchbeam
from protocol.errors import BadInput
from protocol.study_file.loading import StudyError, text_digest
from runner.study.folder import LARGEST_BYTES, StudyFolder, picture_digest
from tests.runner.command_line import typed
from touchbeam.study import reported

PAGE = """
[[page]]
picture = "pictures/hand.png"
text = { en = "Like this.", zh = "如图。" }
"""


def png(width: int = 8, height: int = 8, colour: str = "red", form: str = "PNG") -> bytes:
    data = BytesIO()
    Image.new("RGB", (width, height), colour).save(data, form)
    return data.getvalue()


CHANGED = "study.toml has changed since the last rehearsal."


@pytest.fixture
def study(tmp_path: Path) -> StudyFolder:
    folder = tmp_path / "study"
    assert typed("new", folder) == 0
    with (folder / "study.toml").open("a", encoding="utf-8") as file:
        file.write(PAGE)
    (folder / "pictures").mkdir()
    (folder / "pictures" / "hand.png").write_bytes(png())
    return StudyFolder(path=folder)


def test_a_changed_picture_is_a_changed_study(
    study: StudyFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    run = ("run", study.path, "--ratings", "virtual", "--participant")
    assert typed(*run, "P01") == 0
    before = text_digest(study.text())
    (study.path / "pictures" / "hand.png").write_bytes(png(colour="blue"))
    assert text_digest(study.text()) != before
    capsys.readouterr()
    assert typed(*run, "P02") == 0
    assert CHANGED in capsys.readouterr().out
    assert typed(*run, "P03") == 0
    assert CHANGED not in capsys.readouterr().out


def test_check_counts_the_pages(study: StudyFolder) -> None:
    assert study.study().pages("session") == (0,)
    assert study.study().pictures.keys() == {"pictures/hand.png"}
    assert typed("check", study.path) == 0


FURTHER = """
[[page]]
before = "block"
block = 1
text = { en = "Now.", zh = "开始。" }
[[page]]
before = "block"
text = { en = "Next.", zh = "下一个。" }
[[page]]
text = { en = "More.", zh = "更多。" }
"""


def test_check_lists_the_pages(study: StudyFolder, capsys: pytest.CaptureFixture[str]) -> None:
    with study.study_file.open("a", encoding="utf-8") as file:
        file.write(FURTHER)
    capsys.readouterr()
    assert typed("check", study.path) == 0
    assert (
        "Pages       before the session: 1 (pictures/hand.png), 4\n"
        "            before block 1: 2\n"
        "            before every block: 3\n"
    ) in capsys.readouterr().out
    assert typed("check", study.path, "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["questions"] == []
    assert shown["pages"] == [
        {"before": "session", "block": None, "picture": "pictures/hand.png"},
        {"before": "block", "block": 1, "picture": None},
        {"before": "block", "block": None, "picture": None},
        {"before": "session", "block": None, "picture": None},
    ]


FAULT = "must be a PNG or JPEG file in the study's folder, got '{}', which {}; "


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"", "is empty"),
        (b"not a picture", "is neither PNG nor JPEG"),
        (png()[:40], "is damaged or cut short"),
        (png(5000, 10), "has 5000 x 10 pixels"),
        (png() + b"\0" * LARGEST_BYTES, "is too large"),
        (png(form="GIF"), "is neither PNG nor JPEG"),
        (None, "is missing"),
    ],
    ids=["empty", "text", "cut", "wide", "large", "gif", "missing"],
)
def test_a_file_that_cannot_be_shown_is_refused(
    study: StudyFolder, data: bytes | None, fault: str
) -> None:
    picture = study.path / "pictures" / "hand.png"
    picture.unlink() if data is None else picture.write_bytes(data)
    told = f"page 1, picture: {FAULT.format('pictures/hand.png', fault)}"
    with pytest.raises(StudyError, match=re.escape(told)):
        study.study()


def test_a_folder_is_no_picture(study: StudyFolder) -> None:
    (study.path / "pictures" / "hand.png").unlink()
    (study.path / "pictures" / "hand.png").mkdir()
    with pytest.raises(StudyError, match=r"which is no file; "):
        study.study()


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("plate.png", FAULT.format("plate.png", "is missing")),
        ("../plate.png", "must name a .png or .jpg file in the study's folder, such as beam.png"),
        ("/tmp/plate.png", "must name a .png or .jpg file in the study's folder"),
        ("plate.svg", "must name a .png or .jpg file in the study's folder"),
    ],
)
def test_the_picture_of_a_surface_is_judged_as_that_of_a_page(
    tmp_path: Path, name: str, told: str
) -> None:
    assert typed("new", tmp_path / "plate", "--template", "plate") == 0
    folder = StudyFolder(path=tmp_path / "plate")
    (folder.path / "plate.png").rename(tmp_path / "plate.png")
    text = folder.study_file.read_text(encoding="utf-8").replace('"plate.png"', f'"{name}"')
    folder.study_file.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError, match=re.escape(f"surface.picture: {told}")):
        folder.study()


def test_a_link_is_refused(study: StudyFolder, tmp_path: Path) -> None:
    inside = study.path / "pictures" / "hand.png"
    outside = inside.rename(tmp_path / "hand.png")
    inside.symlink_to(outside)
    with pytest.raises(BadInput, match="is a link or lies behind one"):
        picture_digest(study.path, "pictures/hand.png")
    inside.unlink()
    (study.path / "pictures").rmdir()
    (study.path / "pictures").symlink_to(tmp_path)
    with pytest.raises(BadInput, match="is a link or lies behind one"):
        picture_digest(study.path, "pictures/hand.png")


@pytest.mark.parametrize(
    "name", ["../hand.png", "/tmp/hand.png", "a/../hand.png", ".hand.png", "hand.svg", "a\\b.png"]
)
def test_a_name_that_leaves_the_folder_is_refused(study: StudyFolder, name: str) -> None:
    text = study.study_file.read_text(encoding="utf-8").replace("pictures/hand.png", name)
    study.study_file.write_text(text.replace("\\", "\\\\"), encoding="utf-8")
    with pytest.raises(StudyError, match=r"must name a \.png or \.jpg file in the study's folder"):
        study.study()


def test_a_text_is_needed_in_every_language_and_must_fit(
    study: StudyFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    text = study.study_file.read_text(encoding="utf-8")
    study.study_file.write_text(text.replace(', zh = "如图。"', ""), encoding="utf-8")
    assert typed("check", study.path) == 2
    assert "page 1, text.zh: must be given, got nothing" in capsys.readouterr().err
    study.study_file.write_text(text.replace("Like this.", "Like this. " * 40), encoding="utf-8")
    assert typed("check", study.path) == 2
    assert "page.0.text.en: a text must fit its place" in capsys.readouterr().err


@pytest.mark.filterwarnings("always:.*results are read without:UserWarning")
def test_results_are_read_without_a_lost_picture(
    study: StudyFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("run", study.path, "--ratings", "virtual", "--participant", "P01") == 0
    before = touchbeam.load(study.path, rehearsals=True)
    (study.path / "pictures" / "hand.png").unlink()
    told = "results are read without the picture 'pictures/hand.png', which is missing"
    with pytest.warns(UserWarning, match=told):
        after = touchbeam.load(study.path, rehearsals=True)
    assert after.trials.equals(before.trials)
    # The study is the recorded one: its digest is, too, which the report says.
    assert after.file == before.file
    assert len(reported(after).attempts) == len(before.recorded.attempts)
    for command in (
        ("report", study.path, "--rehearsals"),
        ("export", study.path, tmp_path / "csv", "--format", "csv", "--rehearsals"),
    ):
        capsys.readouterr()
        assert typed(*command) == 0
        assert capsys.readouterr().err.count(told) == 1
    assert typed("status", study.path) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert "No session can begin or go on: " in last
    assert last.endswith(
        "page 1, picture: " + FAULT.format("pictures/hand.png", "is missing") + "put it there"
    )
    assert typed("status", study.path, "--json") == 0
    assert "which is missing" in json.loads(capsys.readouterr().out)["study_problem"]
    assert typed("run", study.path, "--ratings", "virtual", "--participant", "P02") == 2


def test_results_are_read_also_if_no_session_had_the_picture(study: StudyFolder) -> None:
    text = study.study_file.read_text(encoding="utf-8")
    study.study_file.write_text(text.replace(PAGE, ""), encoding="utf-8")
    assert typed("run", study.path, "--ratings", "virtual", "--participant", "P01") == 0
    study.study_file.write_text(text.replace("hand.png", "foot.png"), encoding="utf-8")
    with pytest.warns(UserWarning, match="foot.png', which is missing"):
        assert len(touchbeam.load(study.path, rehearsals=True).sessions) == 1


@pytest.mark.parametrize(
    ("head", "tail", "rule"),
    [
        ("pictures = 3 # [pictures]\n", "", "must be a table, got 3"),
        ("", '\n[pictures]\n"b.png" = 3\n', "must be a text, got 3"),
    ],
)
def test_what_a_stranger_wrote_about_pictures_is_judged_as_the_rest_of_the_study(
    study: StudyFolder, capsys: pytest.CaptureFixture[str], head: str, tail: str, rule: str
) -> None:
    text = study.study_file.read_text(encoding="utf-8").replace(PAGE, "")
    study.study_file.write_text(text, encoding="utf-8")
    assert typed("run", study.path, "--ratings", "virtual", "--participant", "P01") == 0
    study.study_file.write_text(f"{head}{text}{tail}", encoding="utf-8")
    capsys.readouterr()
    assert typed("report", study.path, "--rehearsals") == 2
    assert rule in capsys.readouterr().err
