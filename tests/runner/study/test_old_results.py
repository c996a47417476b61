"""Reports and exports that still hold a participant who has withdrawn."""

import html
import json
import os
from pathlib import Path

import pytest

from runner.study import old_results as search
from runner.study.old_results import old_results

HOLDING = {
    "trials.csv": "participant,session\nP01,1\nP-1,1\n",
    "quoted.csv": 'session,participant\n1,"P-1"\n',
    "formula.csv": "participant\n'P-1\n",
    "other.csv": "code,score\nP-1,7\n",
    "broken.csv": "participant\n" + "x" * 200_000 + "\nP-1\n",
    "participants.tsv": "participant_id\tpseudonym\nsub-P1\tP-1\n",
    "report.json": '{"rows": [{"subject": "P-1"}]}',
    "report.html": '<tr><th scope="row">P-1</th><td>7</td></tr>',
    "scores.svg": "<!-- P-1 -->",
    "README.md": "The chain of P-1/1 is broken.",
    "table4.tex": "P-1 & 7 \\\\",
}
OTHERS = {
    "trials.csv": "participant,session,notes\nP-10,1,as P-1\nXP-1,1,\n",
    "participants.tsv": "participant_id\tpseudonym\nsub-P1\tP-1x\n",
    "report.json": '{"rows": [{"subject": "P-1-2"}]}',
    "report.html": "<td>P-11</td>",
    "study.toml": 'name = "P-1"',
    "figure.png": "P-1",
}


@pytest.mark.parametrize(("name", "text"), HOLDING.items())
def test_a_file_that_holds_the_participant_is_found(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert old_results(tmp_path, "P-1").holding == (name,)


@pytest.mark.parametrize(("name", "text"), OTHERS.items())
def test_files_about_others_are_not_named(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert old_results(tmp_path, "P-1").holding == ()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("trials.csv", "participant,session\n12,7\n"),
        ("report.json", '{"subject": "12", "score": 7, "text": "7 of 9"}'),
        ("report.html", '<td colspan="7">7</td><th scope="row">12</th>'),
        ("table4.tex", "12 & 7 & 7"),
    ],
)
def test_a_number_is_a_participant_only_where_names_are(
    tmp_path: Path, name: str, text: str
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert old_results(tmp_path, "7").holding == ()
    assert old_results(tmp_path, "12").holding == (name,)


@pytest.mark.parametrize("name", ["受试者 1", 'a "b" 1', "x_1", "R&D 1"])
def test_any_name_of_an_imported_table_is_found(tmp_path: Path, name: str) -> None:
    forms = (json.dumps(name), html.escape(name), name, name.replace("_", r"\_"))
    for number, form in enumerate(forms):
        (tmp_path / f"{number}.html").write_text(f"<td>{form}</td>", encoding="utf-8")
    assert len(old_results(tmp_path, name).holding) == len(forms)


def test_a_report_or_export_is_named_once_by_its_folder(tmp_path: Path) -> None:
    for path in (
        "report/report.json",
        "report/report.html",
        "export/bids/dataset_description.json",
        "export/bids/sub-P1/beh/sub-P1_beh.tsv",
        "export/csv/trials.csv",
        "notes/mine.txt",
    ):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("participant\nP-1\n", encoding="utf-8")
    found = old_results(tmp_path, "P-1")
    assert found.holding == ("export/bids", "export/csv", "notes/mine.txt", "report")
    assert found.unsearched == 0


def test_links_and_pipes_are_not_followed(tmp_path: Path) -> None:
    outside, study = tmp_path / "outside", tmp_path / "study"
    outside.mkdir()
    study.mkdir()
    (outside / "trials.csv").write_text("participant\nP-1\n")
    (study / "linked").symlink_to(outside)
    (study / "linked.csv").symlink_to(outside / "trials.csv")
    os.mkfifo(study / "pipe.csv")
    assert old_results(study, "P-1") == search.OldResults(holding=(), unsearched=0)


def test_the_search_is_bounded_and_says_what_it_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(5):
        (tmp_path / f"{number}.csv").write_text("participant\nP-1\n")
    monkeypatch.setattr(search, "MOST_FILES", 3)
    assert old_results(tmp_path, "P-1") == search.OldResults(
        holding=("0.csv", "1.csv", "2.csv"), unsearched=2
    )
    monkeypatch.setattr(search, "MOST_BYTES", 20)
    assert old_results(tmp_path, "P-1").unsearched == 4
