"""Two thousand texts that attack whatever shows them, in one study: each stays text everywhere."""

import csv
import io
import json
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from itertools import count, islice
from pathlib import Path

import pytest

from analysis.cells import json_text
from analysis.export.bids import bids_export
from analysis.export.dataset import dataset
from analysis.export.formats import EXPORTS
from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.table4_text import escaped
from protocol.journal.events import StoredEvent
from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import open_journal
from tests.analysis.export.data_slips import bids_slips, psychds_slips, text_slips
from tests.analysis.export.test_formats import NOBODY_SAID, warnings, written
from tests.analysis.hostile_study import PUBLICATION, Written
from tests.analysis.reports import ORIGIN
from tests.runner.command_line import typed

QUESTIONS, SESSIONS = 36, 8
TEXT = (
    template("paper")
    + PUBLICATION
    + "".join(
        f'[[question]]\nname = "q{number}"\nkind = "text"\nwhen = "trial"\n'
        'text = { en = "Why?", zh = "为什么？" }\n'
        for number in range(QUESTIONS)
    )
)
STUDY = parsed_study(TEXT)
PARTS = (
    *("=1+1", "+cmd|' /C calc'!A0", "-2", '@SUM("a")', "＝1", ";=2", "\t=3", ",=4", '"=5'),
    *("\x00", "\a", "\x1b[31m", "\x1b]0;title\x07", "\x9b2J", "\r", "\r\n", "\n", "\x0b", "\x0c"),
    *("\x85", "\u2028", "\u2029", "\ufeff", "\u200f", "\u202e", "\u2066", "\u2069", "\ud800"),
    *("<script>alert(1)</script>", "</td></table><img src=x onerror=alert(1)>", "<!--", "-->"),
    *("]]>", "</style>", "<svg/onload=alert(1)>", "&lt;b&gt;", "&#60;i&#62;", "{{7*7}}", "{% x %}"),
    *(
        '" onmouseover="alert(1)',
        "' autofocus onfocus='alert(1)",
        "javascript:alert(1)",
        "<plaintext>",
    ),
    *(
        r"\input{/etc/passwd}",
        r"\write18{id}",
        "$x^2_3$",
        "% gone",
        "#1",
        "~&",
        r"\end{document}",
        "^^M",
    ),
    *("[x](javascript:alert(1))", "![](http://example.org/x)", "`code`", "**b**", "| a | b |"),
    *(
        "%s%n",
        "{0}",
        "${HOME}",
        "$(id)",
        "`id`",
        "'; DROP TABLE event; --",
        "../../x",
        "n/a",
        "NaN",
    ),
    *("触觉", "🖐🏽", "e\u0301", "ﷺ", "\u0000\u0000", "   ", "\U000e0041", "A" * 300),
)
UNSEEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
FORMULA = re.compile(r'[\s"]*[=+\-@＝＋－＠]')
NUMBER = re.compile(r"-\d+(\.\d+)?(e-\d+)?$")
SPLIT = {"csv": "[;\t\n]", "tsv": "[;,]"}
"""Marks at which a spreadsheet may split a cell of such a file."""


def texts(seed: int = 20261123) -> Iterator[str]:
    """Yield ever new texts, a few of them of 100 kB; each ends with a number of its own."""
    rng = random.Random(seed)
    number = 0
    while True:
        number += 1
        parts = rng.choices(PARTS, k=rng.randint(1, 6))
        if number % 400 == 0:
            parts = [*parts, rng.choice(["<b>", "=1;", "x\n"]) * 30_000]
        yield f"{''.join(parts)}§{number}."


@dataclass
class Told(Written):
    """A session in which every text that somebody can type is the next one of `said`."""

    said: Iterator[str] = field(default_factory=texts)

    def add(self, tag: str, **payload: object) -> None:
        if tag == "rig-described":
            payload = {"answers": {"skin state": next(self.said), "humidity": next(self.said)}}
        elif tag == "answered":
            payload["questions"] = [
                {"name": f"q{n}", "answer": next(self.said), "reaction_time_s": 1.0, "trace": None}
                for n in range(QUESTIONS)
            ]
        super().add(tag, **payload)


def sessions(said: Iterator[str]) -> list[Told]:
    """Sessions with two thousand texts: answers, notes, reasons and descriptions of the rig."""
    made = [Told(f"P0{number}", text=TEXT, said=said) for number in range(1, SESSIONS + 1)]
    for number, session in enumerate(made):
        session.arm()
        for trial in session.plan.trials:
            session.start(trial)
            if trial.index == 3:
                session.abort(trial, next(said))
                session.start(trial)
            session.answer(trial, 5 + (trial.index + number) % 4)
            session.add("note", text=next(said))
        session.finish()
        session.add("trial-excluded", index=4, reason=next(said))
    return made


def chains(said: Iterator[str]) -> list[list[StoredEvent]]:
    return [session.events for session in sessions(said)]


@pytest.fixture(scope="module")
def hostile() -> list[list[StoredEvent]]:
    return chains(texts())


@pytest.fixture(scope="module")
def made(hostile: list[list[StoredEvent]]) -> Report:
    """The report with the sections that show texts."""
    whole = report("a study", load_study_data(hostile, rehearsals=False), STUDY, ORIGIN)
    return replace(whole, shown=("questions", "left-out", "checks"))


class Outline(HTMLParser):
    """The tags of a page with their attributes, and its comments and declarations, in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.parts: list[tuple[str, ...]] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.parts.append((tag, *(name for name, _ in attrs)))

    def handle_endtag(self, tag: str) -> None:
        self.parts.append((f"/{tag}",))

    def handle_comment(self, data: str) -> None:
        self.parts.append(("comment", data))

    def handle_decl(self, decl: str) -> None:
        self.parts.append(("declaration", decl))

    def handle_pi(self, data: str) -> None:
        self.parts.append(("instruction", data))

    def unknown_decl(self, data: str) -> None:
        self.parts.append(("unknown", data))


def numbers(text: str) -> set[str]:
    return set(re.findall(r"§\d+\.", text))


def test_no_text_becomes_an_element_or_an_attribute_of_the_page(made: Report) -> None:
    page = report_html(made)
    harmless = load_study_data(chains(f"x§{number}." for number in count(1)), rehearsals=False)
    plain = report_html(replace(made, loaded=harmless))
    assert len(numbers(plain)) > 1_000
    assert numbers(page) == numbers(plain)
    assert Outline(page).parts == Outline(plain).parts
    assert not UNSEEN.search(page)


def test_each_answer_that_counts_stands_in_the_reports_numbers(made: Report) -> None:
    told = json.loads(json_text(report_json(made)))["questions"]
    assert len(numbers(json.dumps(told, ensure_ascii=False))) == SESSIONS * QUESTIONS * 4


@pytest.mark.parametrize("form", EXPORTS)
def test_no_text_breaks_a_table_or_begins_a_formula(
    form: str, hostile: list[list[StoredEvent]]
) -> None:
    exported = EXPORTS[form](dataset(hostile, STUDY, "0", rehearsals=False))
    slips = {"bids": bids_slips, "psychds": psychds_slips}.get(form, text_slips)
    assert list(slips(exported)) == []
    assert len(numbers("".join(exported.values()))) > 2_000
    for path, text in exported.items():
        text.encode()
        assert not CONTROL.search(text), path
        if path.endswith(".json"):
            json.loads(text)
        cells = [cell for row in csv.reader(io.StringIO(text)) for cell in row]
        if path.endswith(".tsv"):
            cells = re.split("[\t\n]", text)
        if path.endswith(("csv", "tsv")):
            parts = (part for cell in cells for part in re.split(SPLIT[path[-3:]], cell))
            assert [it for it in parts if FORMULA.match(it) and not NUMBER.match(it)] == [], path


def test_the_official_validator_finds_no_error(
    hostile: list[list[StoredEvent]], tmp_path: Path
) -> None:
    exported = bids_export(dataset(hostile, STUDY, "0", rehearsals=False))
    assert warnings(written(exported, tmp_path)) == NOBODY_SAID


def test_no_text_is_a_command_of_latex() -> None:
    for text in islice(texts(), 1_000):
        left = re.sub(r"\\(text[a-z]+\{\}|[{}$&#%_])", "", escaped(text))
        assert not re.search(r"[\\$&#%_^~\n\r\x00-\x08\x0b-\x1f]", left)
        assert left.count("{") == left.count("}")


@pytest.mark.parametrize("command", ["status", "verify"])
def test_no_text_reaches_the_terminal_as_a_command(
    command: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = (text.replace("\ud800", "?") for text in texts())  # which no journal can hold
    (tmp_path / "study.toml").write_text(TEXT, encoding="utf-8")
    with open_journal(tmp_path / "study.db") as journal, journal.alone():
        for session in sessions(said):
            for event in session.events:
                journal.append(f"{session.participant}/1", event)
    assert typed(command, tmp_path) == 0
    shown = "".join(capsys.readouterr())
    assert shown
    assert not UNSEEN.search(shown)
