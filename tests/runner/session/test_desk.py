"""Questions at the operator's desk: asked before the first trial, refused, corrected, exported."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from analysis.export.trial_table import frames
from analysis.loading.sessions import load_sessions
from protocol.journal.events import QuestionAnswered, SessionOpened, TrialStarted
from protocol.study_file.loading import StudyError, parsed_study, template
from runner.journal.cohort import states
from runner.journal.opening import open_journal, read_journal
from runner.journal.verification import readable_chains, verdicts
from runner.people.operator_console import recalled
from runner.screens import Correction, Note
from runner.session.loop import run
from runner.session.setup import spoken
from tests.runner.command_line import typed
from tests.runner.fakes import FakeDevice, FakeOperator, FakeParticipant, context

DESK = """
[[question]]
name = "glove"
kind = "choice"
when = "desk"
sessions = "first"
text = { en = "Which glove?", zh = "哪种手套？" }
labels = [
  { value = "none", en = "no glove", zh = "无" },
  { value = "nitrile", en = "nitrile", zh = "丁腈" },
]

[[question]]
name = "glove_mm"
kind = "number"
when = "desk"
asked_if = { question = "glove", is = ["nitrile"] }
minimum = 0
maximum = 2
decimals = 2
unit = "mm"
text = { en = "How thick is it?", zh = "多厚？" }

[[question]]
name = "remark"
kind = "text"
when = "desk"
required = false
text = { en = "Anything else?", zh = "其他？" }
"""
TEXT = template("paper") + DESK


def done(
    folder: Path, answers: list[str], orders: list[tuple[str, Any]] | None = None, text: str = TEXT
) -> tuple[FakeOperator, list[Any]]:
    """Return the operator of a session with these `answers`, and the events of its journal."""
    device = FakeDevice()
    operator = FakeOperator(device, orders or [], answers=["", *answers])  # first the beam's
    operator.answers = list(answers)
    with open_journal(folder / "study.db") as journal:
        run(context(journal, device, FakeParticipant(), text, operator))
        assert all(verdict.ok for verdict in verdicts(journal))
        return operator, [event.record for event in journal.events("P01/1")]


def given(records: list[Any]) -> list[tuple[str, Any, str | None]]:
    return [(it.name, it.answer, it.note) for it in records if isinstance(it, QuestionAnswered)]


def test_the_operator_is_asked_before_the_first_trial(tmp_path: Path) -> None:
    operator, records = done(tmp_path, ["nitrile", "0,8", "", ""])
    assert given(records) == [
        ("glove", "nitrile", None), ("glove_mm", 0.8, None), ("remark", None, None)
    ]  # fmt: skip
    tags = [record.TAG for record in records]
    assert tags.index("question-answered") < tags.index("trial-started")
    assert operator.asked[:3] == [
        "Which glove? (none, nitrile)",
        "How thick is it? (0 to 2, mm)",
        "Anything else? (Enter skips it)",
    ]
    assert "noted: glove_mm 0.8" in operator.notices


def test_a_wrong_answer_is_refused_with_the_reason(tmp_path: Path) -> None:
    operator, records = done(tmp_path, ["latex", "none", ""])
    refused = "the answer to glove must be one of none, nitrile, got 'latex'. Which glove?"
    assert operator.asked[1].startswith(refused)
    assert given(records) == [("glove", "none", None), ("remark", None, None)]


def test_a_resumed_session_asks_only_what_is_left(tmp_path: Path) -> None:
    class Gone(Exception):
        pass

    class Leaving(FakeOperator):
        def answered(self) -> str | None:
            if not self.answers:
                raise Gone
            return super().answered()

    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        left = context(journal, device, FakeParticipant(), TEXT, Leaving(device, answers=["none"]))
        with pytest.raises(Gone):
            run(left)
    _, records = done(tmp_path, [""])
    assert given(records) == [("glove", "none", None), ("remark", None, None)]


def test_an_answer_is_corrected_freely_until_the_session_begins_and_later_with_a_reason(
    tmp_path: Path,
) -> None:
    orders = [
        ("armed", Correction(name="glove_mm", answer="3")),
        ("armed", Correction(name="glove_mm", answer="0.9")),
        ("touching", Correction(name="glove_mm", answer="1.1")),
        ("touching", Correction(name="glove_mm", answer="1.1", note="read wrongly")),
        ("touching", Correction(name="age", answer="31", note="why not")),
    ]

    class Late(FakeOperator):
        def order(self) -> Any:
            """Give orders only once the desk has been asked."""
            return super().order() if "noted: remark skipped" in self.notices else None

    device = FakeDevice()
    operator = Late(device, orders, answers=["nitrile", "0.8", ""])
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, device, FakeParticipant(), TEXT, operator))
        assert all(verdict.ok for verdict in verdicts(journal))
        events = journal.events("P01/1")
    records = [event.record for event in events]
    assert given(records)[3:] == [("glove_mm", 0.9, None), ("glove_mm", 1.1, "read wrongly")]
    corrections = [it for it in records if isinstance(it, QuestionAnswered)][3:]
    assert [it.reaction_time_s for it in corrections] == [0.0, 0.0], "nobody was timed"
    begun = next(at for at, it in enumerate(records) if isinstance(it, TrialStarted))
    notes = [at for at, it in enumerate(records) if getattr(it, "note", None)]
    assert notes[0] > begun
    said = "\n".join(operator.notices)
    assert "must be a number with at most 2 decimals, at least 0, at most 2, got '3'" in said
    assert "the session has begun: add the reason" in said
    assert "'age' has no answer to correct; answered: glove, glove_mm, remark" in said
    assert "corrected: glove_mm 1.1" in said
    told = [text for _, text in recalled(events)]
    assert "noted: glove_mm 1.1 (read wrongly)" in told
    with read_journal(tmp_path / "study.db") as journal:
        answers = load_sessions(readable_chains(journal, [])).answers
    desk = answers[answers["when"] == "desk"].set_index("name")["answer"]
    assert desk.to_dict() == {"glove": "nitrile", "glove_mm": 1.1, "remark": None}


def test_an_answer_no_longer_counts_where_a_correction_takes_its_condition_away(
    tmp_path: Path,
) -> None:
    orders: list[tuple[str, Any]] = [
        ("touching", Correction(name="glove", answer="none", note="seen"))
    ]
    operator, records = done(tmp_path, ["nitrile", "0.8", ""], orders)
    assert "corrected: glove none; no longer counts: glove_mm" in operator.notices
    assert [it.moot for it in records if isinstance(it, QuestionAnswered)][-1] == ("glove_mm",)
    with read_journal(tmp_path / "study.db") as journal:
        assert {name for name, _ in states(journal)["P01/1"].questions} == {"glove", "remark"}
        recorded = load_sessions(readable_chains(journal, []))
    assert recorded.answers["name"].tolist() == ["glove", "remark"]
    trials = frames(parsed_study(TEXT), recorded, rehearsals=False).trials
    assert trials["glove_mm"].isna().all()
    assert set(trials["glove"]) == {"none"}


def test_a_question_that_a_correction_leads_to_is_answered_in_the_same_way(tmp_path: Path) -> None:
    orders: list[tuple[str, Any]] = [
        ("touching", Correction(name="glove_mm", answer="0.8", note="read")),
        ("touching", Correction(name="glove", answer="nitrile", note="seen")),
        ("touching", Correction(name="glove_mm", answer="0.8", note="read")),
    ]
    operator, records = done(tmp_path, ["none", ""], orders)
    said = [text for text in operator.notices if "glove_mm" in text]
    assert said == [
        "'glove_mm' has no answer to correct; answered: glove, remark",
        "corrected: glove nitrile; now asked for: glove_mm; answer it as a correction",
        "corrected: glove_mm 0.8",
    ]
    assert given(records)[-1] == ("glove_mm", 0.8, "read")


@pytest.mark.parametrize(
    ("first", "corrected", "answers", "names"),
    [
        ("nitrile", "none", ["0.8"], ["glove", "glove", "remark"]),
        ("none", "nitrile", ["", "0.8"], ["glove", "glove", "remark", "glove_mm"]),
    ],
)
def test_a_correction_while_the_desk_asks_decides_on_what_it_asks(
    tmp_path: Path, first: str, corrected: str, answers: list[str], names: list[str]
) -> None:
    class Correcting(FakeOperator):
        def answered(self) -> str | None:
            """Correct the first answer while the second question stands."""
            if (
                len(self.asked) == 2
                and not self.orders
                and f"corrected: glove {corrected}" not in (self.notices)
            ):
                self.orders.append(("armed", Correction(name="glove", answer=corrected)))
                return None
            return super().answered()

    device = FakeDevice()
    operator = Correcting(device, answers=[first, *answers, "", ""])
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, device, FakeParticipant(), TEXT, operator))
        records = [event.record for event in journal.events("P01/1")]
    assert [name for name, _, _ in given(records)] == names


def test_the_log_of_an_interrupted_session_comes_from_the_journal(tmp_path: Path) -> None:
    orders: list[tuple[str, Any]] = [("touching", Note(text="skin dry")), ("touching", "stop")]
    with pytest.raises(Exception, match="stopped by the operator"):
        done(tmp_path, ["none", ""], orders)
    with read_journal(tmp_path / "study.db") as journal:
        told = recalled(journal.events("P01/1"))
    assert [text for _, text in told] == [
        "noted: glove none",
        "noted: remark skipped",
        "noted: skin dry",
        "trial aborted: stopped by the operator",
        "device off: stopped by the operator",
    ]


def test_the_operator_sees_the_participants_page(tmp_path: Path) -> None:
    operator, _ = done(tmp_path, ["none", ""])
    pages = list(dict.fromkeys(operator.pages))
    assert {"wait", "welcome", "a touch", "remember", "question roughness", "thanks"} <= {*pages}


def test_a_blind_operator_sees_no_page_that_tells_a_condition(tmp_path: Path) -> None:
    blind = TEXT.replace("[design]", "[session]\nblind_operator = true\n\n[design]")
    operator, _ = done(tmp_path, ["none", ""], text=blind)
    known = {"wait", "welcome", "a touch", "touch", "remember", "a question", "thanks"}
    assert {*operator.pages} == known


def test_desk_questions_are_checked() -> None:
    for wrong, right, said in (
        ('sessions = "first"', 'sessions = "first"\nconditions = ["voltage"]', "conditions"),
        ('is = ["nitrile"]', 'is = ["wool"]', "of the answers to glove"),
        ('when = "desk"\nasked_if', 'when = "before"\nasked_if', ""),
        ('when = "desk"\nsessions', 'when = "before"\nsessions', "must be 'before' as that of"),
    ):
        text = TEXT.replace(wrong, right)
        assert text != TEXT
        if said:
            with pytest.raises(StudyError, match=said):
                parsed_study(text)
        else:
            parsed_study(text)


def test_a_question_says_what_may_answer_it() -> None:
    study = parsed_study(TEXT)
    assert [spoken(it) for it in study.questions("desk", 2)] == [
        "How thick is it? (0 to 2, mm)", "Anything else? (Enter skips it)"
    ]  # fmt: skip


def test_a_rehearsal_draws_the_answers_and_exports_have_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = TEXT.replace("[design]", "[design]\nsessions = 2")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    for number in "12":
        run_it = ("--participant", "P01", "--session", number, "--ratings", "virtual")
        assert typed("run", str(tmp_path), *run_it) == 0, capsys.readouterr().err
    out = tmp_path / "out"
    assert typed("export", str(tmp_path), str(out), "--format", "csv", "--rehearsals") == 0
    with (out / "trials.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["glove"] for row in rows} <= {"none", "nitrile"}
    assert {row["session"] for row in rows} == {"1", "2"}
    assert len({row["glove"] for row in rows}) == 1, "it was asked once, and stands for both"
    with read_journal(tmp_path / "study.db") as journal:
        records = [event.record for event in journal.events("P01/1 (rehearsal)")]
    assert isinstance(records[0], SessionOpened)
    assert {name: it for name, it, _ in given(records)}["glove"] == rows[0]["glove"]


GROUPS = """
[[group]]
name = "bare"
size = 4
when = { question = "glove", is = ["none"] }
[[group]]
name = "gloved"
size = 4
when = { question = "glove", is = ["nitrile"] }
"""


def test_a_correction_that_means_another_group_says_what_to_do(tmp_path: Path) -> None:
    text = TEXT.replace("[design]", '[design]\nassign_groups = "by an answer"')
    text = text.replace("\nparticipants = 9 ", "\n# ") + GROUPS
    device = FakeDevice()
    orders: list[tuple[str, Any]] = [
        ("touching", Correction(name="glove", answer=answer, note="seen"))
        for answer in ("nitrile", "none")
    ]
    operator = FakeOperator(device, orders, answers=["none", ""])
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, FakeParticipant(), text, operator)
        session = replace(made.session, group="bare")
        run(replace(made, session=session))
    there, back = (said for said in operator.notices if said.startswith("corrected: glove"))
    assert "the session keeps its group, bare, because its trials are planned: for gloved" in there
    assert back == "corrected: glove none"
