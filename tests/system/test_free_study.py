"""A study that says everything itself: its questions, pages, pictures, scales and language.

It is checked, run by virtual participants and by hand in a window, reported and exported.
"""

import json
import re
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from PIL import Image, ImageDraw

from protocol.study.languages import FOLDER
from runner.window.elements import INK
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.command_line import typed
from tests.runner.window.person import Person, Sight, _colour, virtual_display
from tests.runner.window.sessions import Seat, tiny_study

pytestmark = pytest.mark.waits

VALIDATOR = str(Path(sys.executable).with_name("bids-validator-deno"))
PAGES = """
[[page]]
picture = "pictures/beam.png"
text = { en = "This is the beam.", zh = "这是振动梁。", fr = "Voici la lame." }

[[page]]
before = "block"
text = { en = "Now it counts.\\nTake your time.", zh = "现在开始正式实验。", fr = "C'est parti." }
"""
FRENCH = {
    "How pleasant was the last touch?": "Ce toucher était-il agréable ?",
    "How sure are you of your answer?": "En êtes-vous sûr ?",
    "What did you feel?": "Qu'avez-vous senti ?",
    "Which hand do you write with?": "De quelle main écrivez-vous ?",
    "How old are you?": "Quel âge avez-vous ?",
}


def free_study() -> str:
    """The paper's study with one condition and, in three languages, all that may be added."""
    text = OWN_QUESTIONS.replace('["voltage", "pressure"]', '["frequency"]')
    text = re.sub(r'  \{ value = "(warmth|slipping)".*\n', "", text)  # three labels, one column
    text = re.sub(
        r'\ben = "([^"]*)"',
        lambda found: f'{found[0]}, fr = "{FRENCH.get(found[1], f"{found[1]} (fr)")}"',
        text,
    )
    rules = '[session]\nlanguage = "fr"\nlanguages = ["en", "zh", "fr"]\n\n[rating]'
    return tiny_study().replace("[rating]", rules) + text + PAGES


def furnish(folder: Path) -> None:
    """Put the picture and the third language beside the study file."""
    (folder / "texts").mkdir(parents=True)
    english = (FOLDER / "en.toml").read_text(encoding="utf-8")
    french = english.replace('name = "English"', 'name = "French"')
    (folder / "texts" / "fr.toml").write_text(french, encoding="utf-8")
    (folder / "pictures").mkdir()
    picture = Image.new("RGB", (400, 160), "#eeeecc")
    ImageDraw.Draw(picture).rectangle((40, 70, 360, 90), fill="grey")
    picture.save(folder / "pictures" / "beam.png")


@dataclass
class Writer(Person):
    """A person who also types where something is to be typed."""

    texts: list[str] = field(default_factory=list)

    def act(self) -> None:
        """Type if the page has a frame for it, else do what any person does."""
        if not self._may_type():
            return super().act()
        time.sleep(1.0)  # what is typed before a page can be read is not taken
        self.xdotool("type", "--delay", "30", self.texts.pop(0))
        until_s = time.monotonic() + 10
        while self._may_type() and time.monotonic() < until_s:
            self.key("Return")  # which counts once the page has been readable for long enough
            time.sleep(0.5)
        return None

    def sight(self) -> Sight:
        """Return the kind of page; one to type on is none of those."""
        sight = super().sight()
        return "nothing" if self._may_type() else sight

    def _may_type(self) -> bool:
        image = self.look()
        return {_colour(image, (x, 108.0)) for x in (-300.0, 300.0)} == {INK}


@pytest.fixture(scope="module")
def by_hand(tmp_path_factory: pytest.TempPathFactory) -> tuple[Seat, int, str]:
    """A session in which somebody answers in the window."""
    folder = tmp_path_factory.mktemp("free") / "study"
    furnish(folder)
    with virtual_display(800, 600) as display:
        seat = Seat(folder, display, study=free_study())
        person = Writer(
            display, "mouse", choices=[0] * 10, scores=[3] * 9, texts=["31", "a bit rough"]
        )
        with seat.start("--consent", "C-7") as session:
            code = session.attend(person)
        return seat, code, session.complaint


def test_what_is_answered_in_the_window_is_journalled(by_hand: tuple[Seat, int, str]) -> None:
    seat, code, complaint = by_hand
    assert code == 0, complaint
    apart = {given["name"]: given for given in seat.payloads("question-answered")}
    assert {name: given["answer"] for name, given in apart.items()} == {
        "hand": "left",
        "age": 31,
        "sensations": ["vibration"],
        "remarks": "a bit rough",
    }
    assert apart["age"]["trace"]["changes"][-1]["value"] == "31"
    about = seat.payloads("answered")[-1]["questions"]
    assert [given["name"] for given in about] == ["pleasantness", "confidence"]
    assert [given["answer"] for given in about] == [3, pytest.approx(30, abs=0.2)]
    assert all(given["trace"]["path"] for given in about)
    assert about[1]["trace"]["scale"]["labels"] == []
    (opened,) = seat.payloads("session-opened")
    assert opened["language"] == "fr"
    assert '"pictures/beam.png" = ' in opened["study_text"]


def test_it_is_checked_rehearsed_reported_and_exported(
    by_hand: tuple[Seat, int, str], tmp_path: Path
) -> None:
    folder = by_hand[0].folder
    assert typed("check", folder) == 0
    for participant in ("R1", "R2"):
        assert typed("run", folder, "--participant", participant, "--ratings", "virtual") == 0
    assert typed("verify", folder) == 0
    assert typed("report", folder, "--rehearsals", "--out", tmp_path / "report") == 0
    found = json.loads((tmp_path / "report" / "report.json").read_text(encoding="utf-8"))
    assert len(found["questions"]) == 6
    for form in ("csv", "psychds", "bids"):
        to = tmp_path / form
        assert typed("export", folder, to, "--format", form, "--rehearsals") == 0
    said = subprocess.run(
        [VALIDATOR, str(tmp_path / "bids"), "--format", "json"],
        capture_output=True,
        text=True,
        check=False,
    )
    issues = json.loads(said.stdout)["issues"]["issues"]
    assert [issue for issue in issues if issue["severity"] == "error"] == []
