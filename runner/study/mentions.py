"""Whether a file names a person: texts, tables, spreadsheets, journals and archives of these.

A file may come from anybody. Nothing in it is executed, nothing is unpacked beside it, and of an
archive no more is read than the `Budget` has left.
"""

import bz2
import csv
import gzip
import html
import io
import json
import lzma
import re
import tarfile
import zipfile
import zlib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE, BOM_UTF32_BE, BOM_UTF32_LE
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import IO, Any

from runner.journal.database import log_of
from runner.journal.names import chains_of
from runner.journal.opening import read_journal
from runner.journal.store import JournalError
from runner.study.files import opened_itself


class NotSearched(Exception):
    """A file that cannot be searched: too large, damaged, encrypted, or of a kind without text."""


class Picture(NotSearched):
    """A picture or a PDF, which shows names as shapes."""


@dataclass(kw_only=True)
class Budget:
    """How many files, and how many bytes of these and of what is packed in them, may be read."""

    files_left: int
    bytes_left: int

    def take_file(self) -> None:
        """Count a file as read, or raise `NotSearched` if there are too many."""
        if not self.files_left:
            raise NotSearched
        self.files_left -= 1

    def take(self, size: int) -> None:
        """Count bytes as read, or raise `NotSearched` if they are too many."""
        if size > self.bytes_left:
            raise NotSearched
        self.bytes_left -= size

    def read(self, file: IO[bytes]) -> bytes:
        """Return the content of `file`, whatever size it says that it has."""
        content = file.read(self.bytes_left + 1)
        self.take(len(content))
        return content


# How a person is written


@dataclass(frozen=True, kw_only=True)
class Person:
    """A person by pseudonym: the participant, or the `rehearsal` of that name.

    `others` are the other people of the study, whose names may contain this one.
    """

    name: str
    rehearsal: bool = False
    others: tuple[str, ...] = ()

    def may_be_in(self, text: str) -> bool:
        """Return whether a text has the name, perhaps within another's; this is told fast."""
        return any(form in text for form in self._forms)

    def is_in(self, text: str) -> bool:
        """Return whether a text names the person."""
        return self.may_be_in(text) and any(match[1] for match in self.in_text.finditer(text))

    @cached_property
    def _forms(self) -> frozenset[str]:
        """How the name may be written; exactly, if somebody else's differs only by case."""
        others = {other.lower() for other in self.others}
        return _forms(self.name, cases=self.name.lower() not in others)

    @cached_property
    def in_text(self) -> re.Pattern[str]:
        r"""The pattern whose group is the name in a text; a number must stand where names do.

        >>> names = r"P_10, P_1-2, xP_1, sub-P_1, P\_1 & 7, P_1/1, p_1_left"
        >>> [name for name in Person(name="P_1", others=("P_1-2",)).in_text.findall(names) if name]
        ['P_1', 'P\\_1', 'P_1', 'p_1']
        >>> Person(name="P1").in_text.findall("P1/1 (rehearsal), P1 (rehearsal)")
        []
        >>> number = Person(name="7").in_text
        >>> number.findall('{"score": 7, "subject": "7"} <td>7</td> 7/1 Participant 7')
        ['"7"', '7/1', 'Participant 7']
        """
        # A bare number stands everywhere in a report.
        if self.name.isdecimal():
            own, name = self._not_namesake, self.name
            who = rf"(?i:participant|pseudonym|subject)\W{{1,3}}{name}(?![\w.])"
            return re.compile(
                rf'(?m)((?<!=)"{name}["/]{own}|"row">{name}<|^{name} &|'
                rf"(?<![\w./-]){name}/\d+{own}|{who})"
            )
        return self._alone(_NOT_WITHIN_A_WORD)

    @property
    def _not_namesake(self) -> str:
        # The participant's name is not the rehearsal's; who rehearsed may be called by it alone.
        return "" if self.rehearsal else r"(?!(?:/\d+)? \(rehearsal\))"

    def _alone(self, before: str) -> re.Pattern[str]:
        """Return the pattern of the name, its group, or of a longer name around it."""
        after = "(?:rehearsal)?" if self.rehearsal else ""
        name = rf"({_any_of(self._forms)}{after}){_WORD_ENDS}"
        longer = (other for other in self.others if len(other) > len(self.name))
        around = [form for other in longer if re.search(name, other) for form in _forms(other)]
        mask = rf"{_NOT_WITHIN_A_WORD}{_any_of(around)}{_WORD_ENDS}|" if around else ""
        return re.compile(f"{mask}{before}{name}{self._not_namesake}")

    def is_cell(self, cell: str) -> bool:
        """Return whether a cell of a table names the person.

        >>> [Person(name="7").is_cell(cell) for cell in ("7", "sub-7", "7/2", "7.5", "as 7")]
        [True, True, True, False, False]
        """
        if not self.name.isdecimal():
            return self.is_in(cell)
        kind = r" ?\(?rehearsal\)?" if self.rehearsal else r" \(participant\)"
        # Exports put an apostrophe before what a spreadsheet would take for a formula.
        form = rf"'?(?:sub(?:ject)?-)?{self.name}(?:/\d+)?(?:{kind})?"
        return self.name in cell and re.fullmatch(form, cell.strip()) is not None

    @cached_property
    def in_log(self) -> re.Pattern[bytes]:
        """The pattern of the person's chains in a log of SQLite's."""
        own = "" if self.rehearsal else r"(?! \(rehearsal\))"
        chain = rf"(?<![\w-]){re.escape(self.name)}/\d{{1,9}}(?!\d){own}"
        return re.compile(chain.encode())

    def is_of(self, kinds: str) -> bool:
        """Return whether a row of sessions of these kinds can be the person's."""
        return "rehearsal" in kinds if self.rehearsal else kinds != "rehearsal"

    def is_in_path(self, path: str) -> bool:
        """Return whether the name of a file, or of a folder around it, has this person's.

        >>> person = Person(name="P-1", others=("P-1-2",))
        >>> [person.is_in_path(path) for path in ("P-1_notes.txt", "P-1-2.txt", "a/sub-P-1/b")]
        [True, False, True]
        >>> [Person(name="3").is_in_path(path) for path in ("figure 3.png", "sub-3_beh.tsv")]
        [False, True]
        >>> [Person(name="A1").is_in_path(path) for path in ("notesA1.txt", "data1.csv")]
        [True, False]
        """
        return any(match[1] for match in self._in_path.finditer(path))

    @cached_property
    def _in_path(self) -> re.Pattern[str]:
        if self.name.isdecimal():
            return self._alone("(?:(?<=sub-)|(?<=subject-))")
        if re.search(r"\d", self.name):
            # As in notesP01, but data1 is not about a1.
            return self._alone(f"(?:{_NOT_WITHIN_A_WORD}|(?<=[a-z])(?=[A-Z]))")
        return self._alone(_NOT_WITHIN_A_WORD)


_NOT_WITHIN_A_WORD, _WORD_ENDS = r"(?:(?<![^\W_])|(?<=\\[nrt]))", r"(?![^\W_])"
r"""Names stand beside hyphens and underscores, not beside letters and digits but JSON's `\n`."""


def _forms(name: str, *, cases: bool = True) -> frozenset[str]:
    """Return a name as it is in texts, JSON, HTML, LaTeX and CSV.

    With `cases` also in small letters, in capitals, and with only the first a capital.
    """
    names = {name, name.lower(), name.upper(), name.capitalize()} if cases else {name}
    in_json = {json.dumps(name)[1:-1] for name in names}
    in_latex = {re.sub(r"([&%$#_{}])", r"\\\1", name) for name in names}
    in_csv = {name.replace('"', '""') for name in names}
    return frozenset(names | in_json | set(map(html.escape, names)) | in_latex | in_csv)


def _any_of(forms: Iterable[str]) -> str:
    """Return the pattern of any of some texts, the longest first."""
    return f"(?:{'|'.join(map(re.escape, sorted(forms, key=len, reverse=True)))})"


# What a file is, by its first bytes, because a copy of the journal may have any name.

_DATABASE = b"SQLite format 3\0"
_LOG = (b"\x37\x7f\x06\x82", b"\x37\x7f\x06\x83")
_NO_NAMES = re.compile(
    rb"\x18\xe2\x2d\x00|(?:.{32})?\x93NUMPY..(?:..|....)\{'descr': '[<>|]?[biuf]", re.DOTALL
)
"""The index of a log, and arrays of numbers; before these `power` once put a seal."""
_PACKED: Mapping[bytes, Callable[[Any], Any]] = {
    b"\x1f\x8b": lambda file: gzip.GzipFile(fileobj=file),
    b"BZh": bz2.BZ2File,
    b"\xfd7zXZ\0": lzma.LZMAFile,
}
_ZIP = (b"PK\x03\x04", b"PK\x05\x06")
_OLD_OFFICE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_PICTURES = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"%PDF", b"II*\0", b"MM\0*", b"RIFF")
_UTF16, _UTF32 = (BOM_UTF16_LE, BOM_UTF16_BE), (BOM_UTF32_LE, BOM_UTF32_BE)
_DAMAGED = (
    *(OSError, EOFError, ValueError, LookupError, RuntimeError, NotImplementedError),
    *(zlib.error, lzma.LZMAError, zipfile.BadZipFile, tarfile.TarError),
)
"""What reading an archive can raise."""
_DEEPEST = 4
"""Of archives within archives."""


def file_names(path: Path, person: Person, budget: Budget) -> bool:
    """Return whether the content of a file names the person.

    Raises:
        NotSearched: that cannot be said.
    """
    budget.take_file()
    with open(path, "rb", opener=opened_itself) as file:
        start = file.read(len(_DATABASE))
        budget.take(path.stat().st_size)
        if start != _DATABASE:
            return _content_names(path.name, start + file.read(), person, budget)
    if not log_of(path).exists():
        return _journal_names(path, person)
    # SQLite would put the log into the file and remove it.
    budget.take(log_of(path).stat().st_size)
    with open(log_of(path), "rb", opener=opened_itself) as log:
        return _copy_names(path.read_bytes(), log.read(), person)


def _content_names(
    name: str, content: bytes, person: Person, budget: Budget, depth: int = 0
) -> bool:
    if content.startswith(_DATABASE):
        return _copy_names(content, b"", person)
    if content.startswith(_LOG):
        return person.in_log.search(content) is not None
    if _NO_NAMES.match(content):
        return False
    if content.startswith(_PICTURES):
        raise Picture
    if members := _members(name, content, budget):
        if depth == _DEEPEST:
            raise NotSearched
        return _archive_names(members, person, budget, depth + 1)
    return any(_text_names(name, text, person) for text in _texts(content))


def _texts(content: bytes) -> Iterator[str]:
    """Yield the text of a file; of old Excel and Word files, in both of the codes they use."""
    if content.startswith(_OLD_OFFICE):
        yield from (content.decode(code, "replace") for code in ("latin-1", "utf-16-le"))
    elif content.startswith(_UTF32):  # before UTF-16, whose mark begins one of these
        yield content.decode("utf-32", "replace")
    elif content.startswith(_UTF16):
        yield content.decode("utf-16", "replace")
    elif b"\0" in content:
        raise NotSearched
    else:  # a name can be found in a file that is not all text
        yield content.decode("utf-8-sig", "replace")


def _journal_names(path: Path, person: Person) -> bool:
    """Return whether a copy of a journal has a payload of the person."""
    try:
        with read_journal(path) as journal:
            return any(
                not link.event.erased
                for chain in chains_of(journal, person.name, rehearsal=person.rehearsal)
                for link in journal.chain(chain)
            )
    except JournalError as error:
        raise NotSearched from error


def _copy_names(content: bytes, log: bytes, person: Person) -> bool:
    """Return the same of a journal in memory, with its log."""
    with TemporaryDirectory(prefix="touchbeam-") as folder:
        path = Path(folder) / "copy.db"
        path.write_bytes(content)
        if log:
            log_of(path).write_bytes(log)
        return _journal_names(path, person)


# Texts and tables

_DELIMITERS = ",;\t|"
_WHO = {"participant", "pseudonym", "subject"}
"""The columns of reports and exports that name a participant."""
_KINDS = {"session_kind", "session_kinds"}


def _text_names(name: str, text: str, person: Person) -> bool:
    match PurePosixPath(name).suffix.lower():
        case ".csv" | ".tsv" as suffix:
            return _table_names(text, person, tabs=suffix == ".tsv")
        case ".xml":
            named = any(person.is_cell(line) for line in _without_tags(text).splitlines())
            return named or (not _OFFICE.match(name) and person.is_in(text))
        case _:
            return person.is_in(text)


def _table_names(text: str, person: Person, *, tabs: bool) -> bool:
    """Return whether a row names the person; one of a namesake's sessions is not about this one."""
    decimal = person.name.isdecimal()
    may_name = person.may_be_in if decimal else person.is_in
    if not may_name(text):  # to read all cells takes longer
        return False
    lines = io.StringIO(text, newline="")
    delimiter = max(_DELIMITERS, key=text.partition("\n")[0].count)
    rows: Iterator[list[str]] = csv.reader(lines, delimiter=delimiter)
    if tabs:
        rows = (line.rstrip("\r\n").split("\t") for line in lines)
    try:
        header = next(rows, [])
        titles = [title.strip().lower() for title in header]
        who = {n for n, title in enumerate(titles) if title in _WHO}
        kinds = [n for n, title in enumerate(titles) if title in _KINDS]
        for row in chain([header], rows):
            if not may_name("\t".join(row)):
                continue
            columns = {n for n, cell in enumerate(row) if person.is_cell(cell)}
            # A pseudonym that is a number would be found among scores.
            columns &= who if who and decimal else columns
            of_namesake = not all(person.is_of(row[n]) for n in kinds if n < len(row))
            if columns and not (of_namesake and columns & who):
                return True
    except csv.Error:  # touchbeam did not write it
        return person.is_in(text)
    return False


_OFFICE = re.compile(r"(?:xl|word|ppt)/|(?:.*/)?(?:content|styles|settings)\.xml$")
"""The parts of documents and spreadsheets whose attributes number cells and styles like people."""
_TITLES = re.compile(
    r"""<(?:\w+:)?(?:sheet|table|s)\s(?:[^<>]*\s)?(?:\w+:)?(?:name|v)="""
    r"""(?:"([^"<>]*)"|'([^'<>]*)')[^<>]*>"""
)
"""Names of sheets, and values that a pivot table keeps."""
_BREAKS = re.compile(r"</(?:\w+:)?(?:p|h|si|c)>|<(?:\w+:)?(?:br|cr|line-break)\b[^<>]*>")
"""Between paragraphs, lines and cells."""
_PIECES = r"r|t|rPr\w*|solidFill|delText|ins|del|hyperlink|smartTag|sdt\w*|span|a"
_GAPS = re.compile(rf"</(?!(?:\w+:)?(?:{_PIECES})>)[^<>]*>|<(?:\w+:)?(?:tab|s)\b[^<>]*>")
"""Between words: tabs, spaces, and what closes anything but the pieces of a word."""


def _without_tags(xml: str) -> str:
    """Return the text of a document or a spreadsheet; each paragraph and cell is a line."""
    # A spreadsheet calls its own cells P1 in tags and formulas, and numbers its texts elsewhere.
    text = re.sub(r'<f\b[^<]*</f>|<c\b[^<>]*\bt="s"[^<>]*><v>[^<]*</v></c>', "", xml)
    text = _GAPS.sub(" ", _BREAKS.sub("\n", _TITLES.sub(r"\n\1\2\n", text)))
    return html.unescape(re.sub(r"<[^<>]*>", "", text))


# Archives, spreadsheets and documents among them

Members = Iterator[tuple[str, Callable[[], bytes]]]
"""The files, folders and comments in an archive: name, and what reads it."""


def _members(name: str, content: bytes, budget: Budget) -> Members | None:
    file = io.BytesIO(content)
    for start, opened in _PACKED.items():
        if content.startswith(start):
            return iter([(name.rpartition(".")[0], partial(_unpacked, opened, file, budget))])
    if content.startswith(_ZIP):
        return _zip_members(file, budget)
    if content[257:262] == b"ustar":
        return _tar_members(file, budget)
    return None


def _unpacked(opened: Callable[[Any], Any], packed: object, budget: Budget) -> bytes:
    with opened(packed) as file:
        return budget.read(file)


def _zip_members(file: IO[bytes], budget: Budget) -> Members:
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        for member in members:
            read = partial(_unpacked, archive.open, member, budget)
            yield member.filename, bytes if member.is_dir() else read
        if any(comments := [archive.comment, *(member.comment for member in members)]):
            yield "comments", partial(b"\n".join, comments)


def _tar_members(file: IO[bytes], budget: Budget) -> Members:
    with tarfile.open(fileobj=file, mode="r:") as archive:
        for member in archive:
            part = archive.extractfile(member) if member.isfile() else None
            yield member.name, partial(budget.read, part) if part else bytes


def _archive_names(members: Members, person: Person, budget: Budget, depth: int) -> bool:
    """Return whether one of the files in an archive names the person, or is named so."""
    unread: dict[str, NotSearched] = {}
    known: set[str] = set()
    try:
        for name, read in members:
            if person.is_in_path(name):
                return True
            known.add(name)
            budget.take_file()
            try:
                if _content_names(name, read(), person, budget, depth):
                    return True
            except NotSearched as error:
                unread[name] = error
    except _DAMAGED as error:
        raise NotSearched from error
    for name, why in unread.items():
        if not (isinstance(why, Picture) and known & {*drawn_as_text(name)}):
            raise why
    return False


def drawn_as_text(picture: str) -> Iterator[str]:
    """Yield the names that the SVG of a figure has: the same picture with its text as text.

    >>> list(drawn_as_text("figures/scores-column.pdf"))
    ['figures/scores-column.svg', 'figures/scores.svg']
    """
    stem = str(PurePosixPath(picture).with_suffix(""))
    yield f"{stem}.svg"
    if stem.endswith("-column"):
        yield f"{stem.removesuffix('-column')}.svg"
