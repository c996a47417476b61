"""Files beside the journal that still hold a participant who has withdrawn."""

import bz2
import csv
import gzip
import html
import io
import json
import lzma
import os
import pickle
import sqlite3
import tarfile
import zipfile
from codecs import BOM_UTF32_BE, BOM_UTF32_LE
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from protocol.journal.events import ScoresImported
from runner.clock import WallClock
from runner.journal.amendments import withdraw
from runner.journal.database import log_of
from runner.journal.opening import open_journal
from runner.journal.store import SessionLog
from runner.study import old_results as search
from runner.study.mentions import Person
from runner.study.old_results import OldResults, old_caches, old_results

HOLDING = {
    "trials.csv": "participant,session\nP01,1\nP-1,1\n",
    "quoted.csv": 'session,participant\n1,"P-1"\n',
    "formula.csv": "participant\n'P-1\n",
    "remark.csv": "participant,notes\nP-10,as P-1\n",
    "pairs.csv": "subject,P-1,P-10\nP-10,7,8\n",
    "labels.csv": "subject,score\nsub-P-1,7\n",
    "sessions.tsv": "participant\tscore\nP-1/2\t7\n",
    "dry_remark.csv": "participant,session_kind,notes\nP-10,rehearsal,as P-1\n",
    "other.csv": "code,score\nP-1,7\n",
    "broken.csv": "participant\n" + "x" * 200_000 + "\nP-1\n",
    "participants.tsv": "participant_id\tpseudonym\nsub-P1\tP-1\n",
    "report.json": '{"rows": [{"subject": "P-1"}]}',
    "report.html": '<tr><th scope="row">P-1</th><td>7</td></tr>',
    "scores.svg": "<!-- P-1 -->",
    "README.md": "The chain of P-1/1 is broken.",
    "table4.tex": "P-1 & 7 \\\\",
    "study.toml": 'name = "of P-1"',
    "semicolons.csv": "Code;score\nP-1;7\n",
    "wide.csv": "trial,P-1,P-2\n1,7,8\n",
    "note.csv": "code,note\n8,P-1 was late\n",
    "notes": "What P-1 said",
    "code.R": "# without sub-P-1",
    "Participant P-1.txt": "",
    "P-1/answers.txt": "",
    "sub-P-1_beh.tsv": "score\n7\n",
}
OTHERS = {
    "trials.csv": "participant,session,notes\nP-10,1,as P-10\nXP-1,1,\n",
    "participants.tsv": "participant_id\tpseudonym\nsub-P1\tP-1x\n",
    "report.json": '{"rows": [{"subject": "P-1-2"}]}',
    "report.html": "<td>P-11</td>",
    "study.toml": 'name = "P-12"',
    "rehearsed.csv": "participant,session_kind,file\nP-1,rehearsal,P-1.npz\n",
    "rehearsed.json": '{"subject": "P-1 (rehearsal)", "session": "P-1/1 (rehearsal)"}',
    "P-10.txt": "",
    "P-1-2.txt": "of another participant",
}


NOTHING = OldResults(holding=(), unsearched=())


def search_for(study: Path, name: str = "P-1", *, rehearsal: bool = False) -> OldResults:
    others = ("P-10", "P-1-2", "XP-1")
    return old_results(study, Person(name=name, rehearsal=rehearsal, others=others))


@pytest.mark.parametrize(("name", "text"), HOLDING.items())
def test_a_file_that_holds_the_participant_is_found(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert search_for(tmp_path) == OldResults(holding=(name,), unsearched=())


@pytest.mark.parametrize(("name", "text"), OTHERS.items())
def test_files_about_others_are_not_named(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert search_for(tmp_path) == NOTHING


NAMED = ("sub-P01_task-rating", "P01_left.wav", "participant_P01", "P01-P03", "P01-1", "x-P01")
OF_OTHERS = ("P010", "P010-P011", "XP01", "P01b", "sub-P010_task", "P01-2", "y-P01", "P01_b_left")


@pytest.mark.parametrize(
    "text", [*NAMED, "_P01_", "in p01.", "P01-12", "P01_bothered", '"late\\nP01"']
)
def test_a_name_stands_between_hyphens_and_underscores(tmp_path: Path, text: str) -> None:
    for name in ("a.txt", "a.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
    person = Person(name="P01", others=("P010", "P01-2", "P01_b", "y-P01"))
    assert old_results(tmp_path, person).holding == ("a.csv", "a.txt")


@pytest.mark.parametrize("text", [*OF_OTHERS, r"P01\_b & 7", "p01-2", "sub-P01-2_beh"])
def test_the_name_of_another_participant_is_not_this_one(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    if "\\" not in text:
        (tmp_path / f"{text}.txt").touch()
    person = Person(name="P01", others=("P010", "P01-2", "P01_b", "y-P01"))
    assert old_results(tmp_path, person) == NOTHING


def test_case_tells_names_apart_only_where_participants_differ_by_it(tmp_path: Path) -> None:
    for name in ("p01", "P01", "P01 2"):
        (tmp_path / f"{name}.txt").write_text(name, encoding="utf-8")
    person = Person(name="P01", others=("P02",))
    assert old_results(tmp_path, person).holding == ("P01 2.txt", "P01.txt", "p01.txt")
    person = Person(name="P01", others=("p01",))
    assert old_results(tmp_path, person).holding == ("P01 2.txt", "P01.txt")


def test_a_file_may_be_named_with_a_participant_right_after_small_letters(tmp_path: Path) -> None:
    for name in ("notesP01.txt", "notesP01b.txt", "xP010.txt", "XP01.txt", "data1.csv", "JoAnna"):
        (tmp_path / name).touch()
    for who, holding in (("P01", ("notesP01.txt",)), ("a1", ()), ("Anna", ())):
        assert search_for(tmp_path, who).holding == holding


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("trials.csv", "participant,session\n12,7\n"),
        ("labels.csv", "subject,score\nsub-12,7\n"),
        ("sessions.csv", "subject,score\n12/2,7\n"),
        ("report.json", '{"subject": "12", "score": 7, "text": "7 of 9"}'),
        ("report.html", '<td colspan="7">7</td><th scope="row">12</th>'),
        ("table4.tex", "12 & 7 & 7"),
    ],
)
def test_a_number_is_a_participant_only_where_names_are(
    tmp_path: Path, name: str, text: str
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert search_for(tmp_path, "7").holding == ()
    assert search_for(tmp_path, "12").holding == (name,)


@pytest.mark.parametrize("name", ["受试者 1", 'a "b" 1', "x_1", "R&D 1"])
def test_any_name_of_an_imported_table_is_found(tmp_path: Path, name: str) -> None:
    forms = (json.dumps(name), html.escape(name), name, name.replace("_", r"\_"))
    for number, form in enumerate(forms):
        (tmp_path / f"{number}.html").write_text(f"<td>{form}</td>", encoding="utf-8")
    with (tmp_path / "people.csv").open("w", encoding="utf-8", newline="") as table:
        csv.writer(table).writerow([7, name])
    assert len(search_for(tmp_path, name).holding) == len(forms) + 1


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
    results = search_for(tmp_path)
    assert results.holding == ("export/bids", "export/csv", "notes/mine.txt", "report")
    assert results.unsearched == ()


def test_links_and_pipes_are_not_followed(tmp_path: Path) -> None:
    outside, study = tmp_path / "outside", tmp_path / "study"
    outside.mkdir()
    study.mkdir()
    (outside / "trials.csv").write_text("participant\nP-1\n")
    (study / "linked").symlink_to(outside)
    (study / "linked.csv").symlink_to(outside / "trials.csv")
    os.mkfifo(study / "pipe.csv")
    assert search_for(study) == NOTHING


def test_the_search_is_bounded_and_says_what_it_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(5):
        (tmp_path / f"{number}.csv").write_text("participant\nP-1\n")
    monkeypatch.setattr(search, "MOST_FILES", 3)
    assert search_for(tmp_path) == OldResults(
        holding=("0.csv", "1.csv", "2.csv"), unsearched=("3.csv", "4.csv")
    )
    monkeypatch.setattr(search, "MOST_BYTES", 20)
    assert len(search_for(tmp_path).unsearched) == 4


@pytest.fixture
def withdrawn(tmp_path: Path) -> Path:
    """A study whose `old.db` and kept log are from before the withdrawal of P-1."""
    with open_journal(tmp_path / "study.db") as journal:
        for participant in ("P-1", "P-12"):
            given = {"participant": participant, "conditions": ["a"], "scores": {"a": 8}}
            log = SessionLog(journal, f"{participant}/1", WallClock())
            log.append(ScoresImported.from_json(given))
        (tmp_path / "study.db-wal-kept-17").write_bytes(log_of(tmp_path / "study.db").read_bytes())
        (tmp_path / "old.db").touch()
        journal.copy_to(tmp_path / "old.db")
        withdraw(journal, WallClock(), "P-1")
        (tmp_path / "new.db").touch()
        journal.copy_to(tmp_path / "new.db")
    return tmp_path


def test_copies_of_the_journal_and_kept_logs_are_found_under_any_name(withdrawn: Path) -> None:
    (withdrawn / "backups").mkdir()
    (withdrawn / "old.db").rename(withdrawn / "backups" / "monday.csv")
    before = (withdrawn / "backups" / "monday.csv").read_bytes()
    assert search_for(withdrawn) == OldResults(
        holding=("study.db-wal-kept-17", "backups/monday.csv"), unsearched=()
    )
    assert search_for(withdrawn, "P-2").holding == ()
    assert (withdrawn / "backups" / "monday.csv").read_bytes() == before
    assert len([*withdrawn.iterdir()]) == 4, "no log or index is left beside a copy"


def test_the_log_of_the_study_itself_is_not_searched(withdrawn: Path) -> None:
    (withdrawn / "study.db-wal-kept-17").rename(withdrawn / "study.db-wal")
    (withdrawn / "old.db").unlink()
    assert search_for(withdrawn) == NOTHING


def test_a_database_that_is_no_journal_is_named_as_not_searched(withdrawn: Path) -> None:
    with closing(sqlite3.connect(withdrawn / "new.db")) as other:
        other.execute("CREATE VIEW mine AS SELECT 1")
    (withdrawn / "torn.db").write_bytes((withdrawn / "old.db").read_bytes()[:5000])
    assert search_for(withdrawn) == OldResults(
        holding=("old.db", "study.db-wal-kept-17"), unsearched=("new.db", "torn.db")
    )


def test_a_copy_of_the_journal_is_named_with_its_log_and_stays_as_it_is(tmp_path: Path) -> None:
    copies = tmp_path / "copies"
    copies.mkdir()
    with open_journal(tmp_path / "study.db") as journal:
        given = {"participant": "P-1", "conditions": ["a"], "scores": {"a": 8}}
        SessionLog(journal, "P-1/1", WallClock()).append(ScoresImported.from_json(given))
        for end in ("", "-wal", "-shm"):
            (copies / f"a.db{end}").write_bytes((tmp_path / f"study.db{end}").read_bytes())
        withdraw(journal, WallClock(), "P-1")
    before = {path: path.read_bytes() for path in copies.iterdir()}
    assert search_for(tmp_path).holding == ("copies/a.db", "copies/a.db-shm", "copies/a.db-wal")
    assert {path: path.read_bytes() for path in copies.iterdir()} == before
    (copies / "a.db").unlink()
    (copies / "a.db-shm").unlink()
    assert search_for(tmp_path).holding == ("copies/a.db-wal",)


def test_rehearsals_and_participants_of_one_name_are_told_apart(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        given = {"participant": "P-1", "conditions": ["a"], "scores": {"a": 8}}
        for chain in ("P-1/1", "P-1/1 (rehearsal)"):
            SessionLog(journal, chain, WallClock()).append(ScoresImported.from_json(given))
        withdraw(journal, WallClock(), "P-1")
        (tmp_path / "copy.db").touch()
        journal.copy_to(tmp_path / "copy.db")
    (tmp_path / "dry.csv").write_text("participant,session_kind\nP-1,rehearsal\n")
    (tmp_path / "real.csv").write_text("participant,session_kind\nP-1,participant\n")
    assert search_for(tmp_path).holding == ("real.csv",)
    assert search_for(tmp_path, rehearsal=True).holding == ("copy.db", "dry.csv")


PNG, PDF = b"\x89PNG\r\n\x1a\nP-1", b"%PDF-1.4 P-1"


def test_a_figure_holds_what_its_svg_holds_and_other_pictures_are_named_apart(
    tmp_path: Path,
) -> None:
    for name, content in {
        "people.svg": b"<text>P-1</text>",
        "people.png": PNG,
        "people-column.pdf": PDF,
        "means.svg": b"<text>P-10</text>",
        "means.png": PNG,
        "consent.pdf": PDF,
        "smile.png": PNG,
        "study.toml": b'[[page]]\npicture = "smile.png"\n',
    }.items():
        (tmp_path / name).write_bytes(content)
    assert search_for(tmp_path) == OldResults(
        holding=("people-column.pdf", "people.png", "people.svg"), unsearched=("consent.pdf",)
    )


def zipped(files: Mapping[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


def encrypted(archive: bytes) -> bytes:
    """Return an archive of one file that says twice that it is encrypted."""
    content = bytearray(archive)
    content[6] |= 1
    content[archive.index(b"PK\x01\x02") + 8] |= 1
    return bytes(content)


def tarred(files: Mapping[str, bytes]) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:gz") as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return out.getvalue()


def sheet(cells: str, texts: str = "") -> bytes:
    """Return a spreadsheet of Excel's."""
    cells, texts = f"<sheetData><row>{cells}</row></sheetData>", f"<sst>{texts}</sst>"
    parts = {"xl/worksheets/sheet1.xml": cells, "xl/sharedStrings.xml": texts}
    return zipped({name: part.encode() for name, part in parts.items()})


def document(text: str) -> bytes:
    """Return a document of Word's with one paragraph."""
    return zipped({"word/document.xml": f"<w:p><w:r>{text}</w:r></w:p>".encode()})


def commented(whole: bytes, member: bytes) -> bytes:
    """Return a zip archive that has comments."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.comment, note = whole, zipfile.ZipInfo("a.txt")
        note.comment = member
        archive.writestr(note, "nobody")
    return out.getvalue()


def folder_in_tar(name: str) -> bytes:
    """Return an archive that has only an empty folder."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        member = tarfile.TarInfo(name)
        member.type = tarfile.DIRTYPE
        archive.addfile(member)
    return out.getvalue()


def packed(who: str) -> dict[str, bytes]:
    """Return archives, spreadsheets and documents that name a person."""
    table = {"trials.csv": f"participant\n{who}\n".encode()}
    return {
        "a.zip": zipped(table),
        "deep.zip": zipped({"b.zip": zipped({"c.csv.gz": gzip.compress(table["trials.csv"])})}),
        "named.zip": zipped({f"sub-{who}_beh.tsv": b"score"}),
        "t.csv.gz": gzip.compress(table["trials.csv"]),
        "t.csv.bz2": bz2.compress(table["trials.csv"]),
        "t.csv.xz": lzma.compress(table["trials.csv"]),
        "t.tgz": tarred(table),
        "texts.xlsx": sheet('<c r="A1" t="s"><v>0</v></c>', f"<si><t>{who}</t></si>"),
        "inline.xlsx": sheet(f'<c r="A1" t="inlineStr"><is><t>{who}</t></is></c>'),
        "people.ods": zipped({"content.xml": f"<text:p>{who}</text:p><text:p>7</text:p>".encode()}),
        "runs.docx": zipped(
            {"word/document.xml": f"<w:t>with {who[0]}</w:t><w:t>{who[1:]}</w:t></w:p>".encode()}
        ),
        "break.docx": document(f"<w:t>left</w:t><w:br/><w:t>{who}</w:t><w:br/><w:t>late</w:t>"),
        "tab.docx": document(f"<w:t>left</w:t><w:tab/><w:t>{who}</w:t><w:tab/><w:t>late</w:t>"),
        "link.docx": document(
            f"<w:hyperlink><w:t>{who[0]}</w:t></w:hyperlink><w:t>{who[1:]}</w:t>"
        ),
        "comment.xlsx": zipped(
            {
                "xl/comments1.xml": "<authors><author>me</author></authors><comment ref='P1'>"
                f"<text><r><t>{who}</t></r></text></comment><comment><text>late</text>".encode()
            }
        ),
        "author.xlsx": zipped(
            {"xl/comments1.xml": f"<author>me</author><author>{who}</author><t>late</t>".encode()}
        ),
        "sheet.xlsx": zipped(
            {"xl/workbook.xml": f'<sheet name="{who}" sheetId="1"/><sheet name="2"/>'.encode()}
        ),
        "sheet.ods": zipped({"content.xml": f"<table:table table:name='{who}'>".encode()}),
        "pivot.xlsx": zipped({"xl/pivotCache/a.xml": f'<s v="{who}"/><s v="x"/>'.encode()}),
        "people.xml": f'<people><person id="{who}"/></people>'.encode(),
        "folder.zip": zipped({f"{who}/": b""}),
        "folder.tar": folder_in_tar(f"data/{who}"),
        "comment.zip": commented(f"without {who}".encode(), b""),
        "member.zip": commented(b"", f"by {who}".encode()),
        "utf32le.txt": BOM_UTF32_LE + who.encode("utf-32-le"),
        "utf32be.txt": BOM_UTF32_BE + who.encode("utf-32-be"),
        "old.xls": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0\0" + who.encode() + b"\0",
        "old.doc": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0\0" + f" {who} ".encode("utf-16-le"),
        "unicode.txt": f"with {who}".encode("utf-16"),
    }


def test_archives_spreadsheets_and_documents_are_searched(tmp_path: Path) -> None:
    # A spreadsheet calls its cells P1, and a formula names them.
    cell = '<c r="P1"><f>P1+P1</f><v>7</v></c>'
    about_others = {
        "cells.xlsx": sheet(cell, "<si><t>P10</t></si>"),
        "comment at.xlsx": zipped({"xl/comments1.xml": b'<comment ref="P1"><t>late</t></comment>'}),
        "styled.odt": zipped({"content.xml": b'<text:p text:style-name="P1">late</text:p>'}),
        "split.docx": document("<w:t>P1</w:t></w:r><w:proofErr/><w:r><w:rPr/><w:t>0</w:t>"),
    }
    for who, others in (("P1", {}), ("P10", about_others)):
        (tmp_path / who).mkdir()
        for name, content in (packed(who) | others).items():
            (tmp_path / who / name).write_bytes(content)
    (tmp_path / "P1").rename(tmp_path / "of the first")
    (tmp_path / "P10").rename(tmp_path / "others")
    assert search_for(tmp_path, "P1") == OldResults(
        holding=tuple(f"of the first/{name}" for name in sorted(packed("P1"))), unsearched=()
    )


def test_a_number_is_found_in_a_cell_of_a_spreadsheet(tmp_path: Path) -> None:
    text = '<c r="A1" t="s"><v>3</v></c>'
    (tmp_path / "a.xlsx").write_bytes(sheet(text, "<si><t>5</t></si>" * 4))
    (tmp_path / "b.xlsx").write_bytes(sheet('<c r="A1"><v>3</v></c>'))
    assert search_for(tmp_path, "3").holding == ("b.xlsx",)
    assert search_for(tmp_path, "5").holding == ("a.xlsx",)


def test_a_number_is_not_found_among_what_is_counted_of_a_document(tmp_path: Path) -> None:
    counts = b"<Properties><Pages>5</Pages><Words>300</Words></Properties>"
    (tmp_path / "a.docx").write_bytes(zipped({"docProps/app.xml": counts}))
    assert search_for(tmp_path, "5") == NOTHING


def test_kept_results_of_a_power_analysis_hold_nobody(tmp_path: Path) -> None:
    chunk = io.BytesIO()
    np.save(chunk, np.zeros((3, 2)))
    (tmp_path / "sealed.npy").write_bytes(bytes(range(32)) + chunk.getvalue())
    (tmp_path / "plain.npy").write_bytes(chunk.getvalue())
    names = io.BytesIO()
    np.save(names, np.array(["P-1"]))
    (tmp_path / "names.npy").write_bytes(bytes(range(32)) + names.getvalue())
    assert search_for(tmp_path) == OldResults(holding=(), unsearched=("names.npy",))


def test_a_backup_in_an_archive_is_read_as_a_journal(withdrawn: Path) -> None:
    for name in ("old", "new"):
        content = (withdrawn / f"{name}.db").read_bytes()
        (withdrawn / f"{name}.db").unlink()
        (withdrawn / f"{name}.gz").write_bytes(gzip.compress(content))
        (withdrawn / f"{name}.zip").write_bytes(zipped({"study/monday.db": content}))
    assert search_for(withdrawn) == OldResults(
        holding=("old.gz", "old.zip", "study.db-wal-kept-17"), unsearched=()
    )


def test_what_cannot_be_searched_is_named_and_costs_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, trap = zipped({"a.csv": b"P-1"}), tmp_path / "trap"
    bomb = zipped({"a.txt": bytes(20_000_000)})
    nested = whole
    for _ in range(6):
        nested = zipped({"a.zip": nested})
    for name, content in {
        "bomb.zip": bomb,
        "nested.zip": nested,
        "noise.bin": bytes(range(256)),
        "secret.zip": encrypted(whole),
        "torn.gz": gzip.compress(b"P-1" * 1000)[:20],
        "torn.zip": whole[:-30],
        "torn.tar": tarred({"a": b"P-1"})[:30],
    }.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git" / "index").write_text("P-1")
    (tmp_path / "z.pkl").write_bytes(pickle.dumps(Trap(trap)))
    monkeypatch.setattr(search, "MOST_BYTES", 1_000_000)
    results = search_for(tmp_path)
    assert results.holding == ()
    names = ("bomb.zip", "nested.zip", "noise.bin", "secret.zip", "torn.gz", "torn.tar", "torn.zip")
    assert results.unsearched == (".git", *names, "z.pkl")
    assert not trap.exists()
    assert len([*tmp_path.iterdir()]) == len(names) + 2


class Trap:
    """Read by pickle, it makes a folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return (os.mkdir, (str(self.path),))


def test_caches_of_earlier_versions_are_found_and_no_folder_of_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("TOUCHBEAM_CACHE", str(tmp_path / "mine"))
    assert old_caches() == []
    (tmp_path / "cache" / "touchbeam" / "results").mkdir(parents=True)
    (tmp_path / "mine" / ("0a" * 16)).mkdir(parents=True)
    assert old_caches() == [tmp_path / "cache" / "touchbeam", tmp_path / "mine"]
    (tmp_path / "mine" / "thesis.txt").touch()
    assert old_caches() == [tmp_path / "cache" / "touchbeam"]
