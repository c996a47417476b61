"""A study on disk: study file, journal, languages and report."""

import json
import os
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from hashlib import sha256
from importlib import import_module
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from protocol.errors import BadInput, Problem, typed_as
from protocol.study.fields import LONGEST_NAME, Names, printable
from protocol.study.languages import CODE, FOLDER, REFERENCE, built_in_codes
from protocol.study.study import Study
from protocol.study.study_question import is_digest, is_picture_name
from protocol.study_file.loading import (
    ignored_tables,
    parsed_study,
    picture_names,
    pictures_in,
    table_name,
    with_digests,
    with_languages,
)
from protocol.study_file.toml import toml_document
from runner.study import files

if TYPE_CHECKING:
    from protocol.journal.events import ScoresImported
    from runner.journal.store import Journal

# Pictures of a study: which files may be shown, and their digests.

LARGEST_BYTES = 4_000_000
LARGEST_SIDE = 4_096
_UNKNOWN = "0" * 64
"""In place of the digest of a picture that no session had."""
_FORMATS = MappingProxyType({"PNG": b"\x89PNG", "JPEG": b"\xff\xd8"})
"""How the files of each begin."""


def picture_digest(folder: Path, name: str) -> str:
    """Return the SHA-256 of a picture that may be shown: one that decodes, small, no link.

    Raise `BadInput`, which says what another file is and what to do, after 'which'.
    """
    try:
        whole = folder.resolve(strict=True) / name
        # No link in its path: the picture could otherwise be any file of the user, shown and
        # digested.
        if whole.resolve(strict=True) != whole:
            raise BadInput("is a link or lies behind one; copy the picture itself there")
        if not whole.is_file():
            raise BadInput("is no file; put a picture there")
        with whole.open("rb") as file:
            # One byte more than allowed shows that a file is too large, without reading all of it.
            data = file.read(LARGEST_BYTES + 1)
    except FileNotFoundError:
        raise BadInput("is missing; put it there") from None
    except OSError as error:
        raise BadInput(f"cannot be read ({error.strerror}); make it readable") from None
    _require_shown(data)
    return sha256(data).hexdigest()


def _require_shown(data: bytes) -> None:
    from PIL import Image

    if not data:
        raise BadInput("is empty; put a picture there")
    if len(data) > LARGEST_BYTES:
        raise BadInput(f"is too large; make it smaller, to at most {LARGEST_BYTES // 10**6} MB")
    wide = ""
    try:
        # Only these two decoders: the file may come from a stranger, and others can start programs.
        with Image.open(BytesIO(data), formats=tuple(_FORMATS)) as picture:
            # Before it is decoded, because a small file can hold an enormous picture.
            if max(picture.size) > LARGEST_SIDE:
                wide = "has {} x {} pixels".format(*picture.size)
            else:
                picture.load()
    except Image.DecompressionBombError:
        wide = "has too many pixels"
    except (OSError, ValueError, SyntaxError):
        if data.startswith(tuple(_FORMATS.values())):
            raise BadInput("is damaged or cut short; save it or copy it again") from None
        raise BadInput("is neither PNG nor JPEG; save it as one of these") from None
    if wide:
        raise BadInput(f"{wide}; make it at most {LARGEST_SIDE} pixels wide and high")


# Imported once a study names one, because that takes a while.
DIALECTS: Mapping[str, Names] = MappingProxyType(
    {
        "dialects": lambda: import_module("device.drivers.driver").drivers(),
        "gauge dialects": lambda: import_module("device.gauges.owner").gauges(),
    }
)
"""What devices and gauges may speak, by what a study file calls it."""


@dataclass(frozen=True, kw_only=True)
class StudyFolder:
    """The paths of a study."""

    path: Path

    @property
    def study_file(self) -> Path:
        """The study as its author wrote it."""
        return self.path / "study.toml"

    @property
    def journal(self) -> Path:
        return self.path / "study.db"

    @property
    def report(self) -> Path:
        return self.path / "report"

    def report_sections(self) -> tuple[str, ...] | None:
        """Return the sections that `report.toml` chooses for the report's page, None for all.

        The file is about presentation alone: it is no part of the study and of its digest. Raise
        `BadInput` if it is no TOML, or has other keys than `sections`, a list of texts.
        """
        path = self.path / "report.toml"
        if not path.exists():
            return None
        files.require_no_link(path)
        given = toml_document(files.short_text(path))
        if isinstance(given, Problem):
            raise BadInput(given.located(str(path)))
        names = given.pop("sections", [])
        if given or not isinstance(names, list) or not all(isinstance(it, str) for it in names):
            raise BadInput(f'{path}: must have one key, such as sections = ["methods", "trials"]')
        return tuple(names) or None

    @property
    def languages(self) -> Path:
        """The study's own languages, one file each."""
        return self.path / "texts"

    def text(self, instead: Mapping[str, str] = MappingProxyType({})) -> str:
        """Return the study file with its languages and files' digests, or raise `BadInput`.

        A picture that cannot be shown has in place of a digest what is wrong with it; pictures
        `instead` have the digests given here.
        """
        text = self._study_text()
        whole = with_languages(text, self._languages())
        names = picture_names(text) if "picture" in text else []
        # Other names are no pictures', which the study's own checks say.
        pictures = {name: self._picture(name) for name in names if is_picture_name(name)}
        whole = with_digests(whole, "pictures", {**pictures, **instead})
        if "surface" not in text or (name := table_name(text)) is None:
            return whole
        # Loaded with the first surface that has a table, which few have.
        from runner.study.surface import table_digest

        digest = table_digest(self.path, name)
        return with_digests(whole, "tables", {} if digest is None else {name: digest})

    def _picture(self, name: str) -> str:
        """Return the digest of a picture; of one that cannot be shown what is wrong with it."""
        try:
            return picture_digest(self.path, name)
        except BadInput as fault:
            return str(fault)

    def ignored(self) -> str:
        """Return what nothing obeys in the study file, in words; '' if all is obeyed."""
        return ignored_tables(self._study_text())

    def add_language(self, code: str) -> Path:
        """Copy the texts of a built-in language, else the English ones, into a new file.

        Raise `BadInput` for no study, no such language, a file that is there, or as `own_file`.
        """
        self._study_text()
        if not re.fullmatch(CODE, code):
            raise BadInput(f"a language is named by its code, such as fr or pt-BR, got {code!r}")
        file = files.own_file(self.languages / f"{code}.toml", self.path)
        if file.exists():
            raise BadInput(f"{file}: is there already; edit it, or move it away")
        files.make_folder(self.languages)
        known = code if code in built_in_codes() else REFERENCE
        files.write_whole(file, (FOLDER / f"{known}.toml").read_bytes())
        return file

    def _languages(self) -> dict[str, str]:
        texts = {}
        for file in sorted(self.languages.glob("*.toml")):
            if not re.fullmatch(CODE, file.stem):
                raise BadInput(f"{file}: must be named by a language code, such as fr.toml")
            texts[file.stem] = files.short_text(file)
        return texts

    def _study_text(self) -> str:
        try:
            self.study_file.lstat()
            files.require_no_link(self.study_file)
            return files.short_text(self.study_file)
        except FileNotFoundError:
            if other := self._misnamed:
                raise BadInput(
                    f"{self.path}: the study's file must be called study.toml, got {other!r}; "
                    "rename it (file managers may hide the end of a name)"
                ) from None
            raise BadInput(
                f"{self.path}: no study here (study.toml is missing); {self._instead}"
                f"make one with: touchbeam new {typed_as(self.path)}"
            ) from None
        except NotADirectoryError:
            raise self._not_a_folder() from None
        except OSError as error:
            raise BadInput(f"{self.study_file}: cannot be read ({error.strerror})") from error

    @property
    def _misnamed(self) -> str | None:
        """The file that is meant to be the study's, by its name: study.toml.txt, Study.toml."""
        names = {it.name.casefold(): it.name for it in self.path.glob("*") if it.is_file()}
        close = get_close_matches(self.study_file.name, names, n=1, cutoff=0.7)
        return printable(names[close[0]]) if close else None

    @property
    def _instead(self) -> str:
        """A question for a study whose name is nearly this one, if there is one."""
        if self.path.exists():
            return ""
        beside = self.path.absolute().parent
        studies = [file.parent.name for file in beside.glob("*/study.toml")]
        close = get_close_matches(self.path.name, studies, n=1)
        return f"did you mean {self.path.with_name(close[0])}? Otherwise " if close else ""

    def _not_a_folder(self) -> BadInput:
        return BadInput(
            f"{self.path}: must be the folder that contains study.toml, got a file; "
            f"give {typed_as(self.path.parent)}"
        )

    def study(self) -> Study:
        """Return the checked study; raise `BadInput` if it is missing, `StudyError` if wrong."""
        return parsed_study(self.text(), str(self.study_file), dialects=DIALECTS)

    def recorded(self, journal: "Journal") -> tuple[str, Study]:
        """Return the text and the study by which results are read, which show no picture.

        A picture that cannot be shown gives a warning, and has the digest in the journal. Raise as
        `study` does for everything else.
        """
        text = self.text()
        known, shown = pictures_in(text), picture_names(text)
        lost = {name: known[name] for name in shown if not is_digest(known.get(name, _UNKNOWN))}
        if lost:
            from protocol.journal.events import SessionOpened

            before: dict[str, str] = {}
            for _, opened in journal.records_of(SessionOpened):
                before |= pictures_in(opened.study_text or "")
            text = self.text({name: before.get(name, _UNKNOWN) for name in lost})
        study = parsed_study(text, str(self.study_file), dialects=DIALECTS)
        for name, fault in lost.items():
            told = f"results are read without the picture {name!r}, which {fault}"
            warnings.warn(f"{self.study_file}: {told}", stacklevel=4)
        return text, study

    def existing_journal(self) -> Path:
        """Return the path of the journal; raise `BadInput` if nothing has been recorded yet."""
        if self.path.is_file():
            raise self._not_a_folder()
        if not os.path.lexists(self.journal):  # opening it refuses links, pipes and folders
            raise BadInput(
                f"{self.path}: no sessions here (study.db is missing); {self._instead}"
                "record one with touchbeam run or import scores with touchbeam import"
            )
        return self.journal


@contextmanager
def new_study(folder: StudyFolder, text: str) -> Iterator[StudyFolder]:
    """Create a study from `text` in a new or empty folder, and yield it to the body.

    If the body fails before the first journal event, everything created is removed again. Raise
    `BadInput` if the folder is not empty or cannot be created.
    """
    place = Path(os.path.realpath(folder.path))
    topmost = _created(place)
    try:
        folder.path.stat()  # fails on the way through a folder that is missing
        files.write_whole(folder.study_file, text.encode())
        yield folder
    except BaseException:
        from runner.journal.opening import unused

        # With events in it, a folder holds data, which nothing here may remove.
        if unused(folder.journal):
            # A folder that was there and empty stays.
            files.take_away([topmost] if topmost else place.iterdir())
        raise


def named_after(name: str, text: str) -> str:
    """Return the template `text` with `name` as the study's name, unless it is blank."""
    # A folder's name may be no valid text, and may hold what a terminal would obey.
    shown = printable(name.encode(errors="replace").decode()).strip()[:LONGEST_NAME]
    # A JSON string is also a valid TOML string.
    key = f"name = {json.dumps(shown, ensure_ascii=False)}"
    # A function, because a backslash in a name would be read as a group.
    return re.sub(r'(?m)^name = "\w+"$', lambda _: key, text, count=1) if shown else text


def require_free(folder: StudyFolder) -> None:
    """Raise `BadInput` unless the folder is empty or missing, as far as that can be told."""
    place = Path(os.path.realpath(folder.path))
    try:
        taken = any(place.iterdir())
    except FileNotFoundError:
        return
    except OSError as error:
        raise _unusable(place, error) from error
    if taken:
        raise _taken(place)


def _unusable(place: Path, error: OSError) -> BadInput:
    told = f"cannot be used for a study ({error.strerror}); choose another folder"
    return BadInput(f"{place}: {told}")


def _taken(place: Path) -> BadInput:
    return BadInput(f"{place}: must be a new or empty folder, but it contains files")


def import_scores(
    folder: StudyFolder, text: str, name: str, sessions: "Iterable[ScoresImported]"
) -> None:
    """Create a study from the text of its file, called `name`, with a session for each event."""
    from runner.clock import WallClock
    from runner.journal.names import session_name
    from runner.journal.opening import open_journal
    from runner.journal.store import SessionLog

    called = named_after(name, text)
    with new_study(folder, called), open_journal(folder.journal) as journal, journal.alone():
        for imported in sessions:
            chain = session_name(imported.participant, imported.session)
            SessionLog(journal, chain, WallClock()).append(imported)


def _created(place: Path) -> Path | None:
    """Create the folder `place` unless it exists and is empty; return the topmost new folder."""
    try:
        topmost = files.make_folder(place)
        taken = topmost is None and any(place.iterdir())
    except OSError as error:
        raise _unusable(place, error) from error
    if taken:
        raise _taken(place)
    return topmost


def numbered(path: Path) -> Path:
    """Return `path`, or `path-2`, `path-3`, … if it is taken."""
    candidate, number = path, 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.name}-{number}")
    return candidate
