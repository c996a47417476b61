"""A study on disk: its file, its journal, and what is made from them."""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from protocol.errors import BadInput
from protocol.study.languages import CODE
from protocol.study.study import Study
from protocol.study_file.language_files import with_languages
from protocol.study_file.loading import parsed_study
from runner.study.files import make_folder, short_text, take_away

_PSEUDONYM = re.compile(r"(?=.*[0-9])[A-Za-z0-9][A-Za-z0-9_-]{0,31}")


def dialects() -> Iterable[str]:
    """Return what the devices speak that there is a driver for."""
    from device.drivers.registry import drivers

    return drivers()


@dataclass(frozen=True, kw_only=True)
class StudyFolder:
    """The paths of a study."""

    path: Path

    @property
    def study_file(self) -> Path:
        """The study as its author wrote it."""
        return self.path / "study.toml"

    @property
    def test_file(self) -> Path:
        """Tests of the study, run by pytest."""
        return self.path / "test_study.py"

    @property
    def journal(self) -> Path:
        """Everything that happened."""
        return self.path / "study.db"

    @property
    def report(self) -> Path:
        """Where reports go unless another place is named."""
        return self.path / "report"

    @property
    def languages(self) -> Path:
        """Languages of the study's own, one file each."""
        return self.path / "texts"

    def text(self) -> str:
        """Return the text of the study file, with the files of the study's own languages.

        Raises:
            BadInput: there is none, or nothing that can be a study or a language.
        """
        return with_languages(self._study_text(), self._languages())

    def _languages(self) -> dict[str, str]:
        """What stands in the file of each language, by its code."""
        return {_code(file): _language_text(file) for file in sorted(self.languages.glob("*.toml"))}

    def _study_text(self) -> str:
        try:
            return short_text(self.study_file)
        except FileNotFoundError:
            raise BadInput(
                f"{self.path}: no study here (study.toml is missing); "
                f"make one with: touchbeam new {self.path}"
            ) from None
        except NotADirectoryError:
            raise BadInput(
                f"{self.path}: is a file; give the folder that holds study.toml"
            ) from None
        except (OSError, UnicodeDecodeError) as error:
            raise BadInput(f"{self.study_file}: cannot be read ({error})") from error

    def study(self) -> Study:
        """Return the checked study.

        Raises:
            BadInput: there is none.
            StudyError: it cannot be used.
        """
        return parsed_study(self.text(), str(self.study_file), dialects=dialects)

    def existing_journal(self) -> Path:
        """Return the path of the journal.

        Raises:
            BadInput: nothing has been recorded yet.
        """
        if not self.journal.is_file():
            raise BadInput(
                f"{self.path}: no sessions here (study.db is missing); "
                "record one with touchbeam run, or bring scores in with touchbeam import"
            )
        return self.journal


@contextmanager
def new_study(folder: StudyFolder, text: str) -> Iterator[StudyFolder]:
    """Make a study out of `text`, in a new folder or an empty one, for the body to go on with.

    If the body fails before anything is journalled, nothing of it stays.

    Raises:
        BadInput: the folder is there already and not empty, or cannot be made.
    """
    place = Path(os.path.realpath(folder.path))
    topmost = _made(place)
    try:
        folder.study_file.write_text(text, encoding="utf-8")
        yield folder
    except BaseException:
        from runner.journal.store import unused

        if unused(folder.journal):
            take_away([topmost] if topmost else place.iterdir())
        raise


def _made(place: Path) -> Path | None:
    """Make the folder `place`, unless it is there and empty; return the topmost one made."""
    try:
        topmost = make_folder(place, mode=0o700)
    except OSError as error:
        raise BadInput(
            f"{place}: cannot be made ({error.strerror}); name another folder"
        ) from error
    if topmost is None:
        _require_empty(place)
    return topmost


def _require_empty(path: Path) -> None:
    try:
        taken = any(path.iterdir())
    except OSError as error:
        raise BadInput(f"{path}: no folder for a study ({error.strerror}); name another") from error
    if taken:
        raise BadInput(f"{path}: is there already and not empty; name a new folder")


def _code(file: Path) -> str:
    if not re.fullmatch(CODE, file.stem):
        raise BadInput(f"{file}: must be named by a language's code, as fr.toml")
    return file.stem


def _language_text(file: Path) -> str:
    try:
        return short_text(file)
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{file}: cannot be read ({error})") from error


def numbered(path: Path) -> Path:
    """Return `path`, or `path-2`, `path-3`, … if it is taken."""
    candidate, number = path, 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.name}-{number}")
    return candidate


def pseudonym(text: str) -> str:
    """Return `text` if it can stand for a participant.

    Raises:
        BadInput: it could be a name, or could leave the study's folder.
    """
    if not _PSEUDONYM.fullmatch(text):
        raise BadInput(
            "a participant must be a pseudonym of letters, digits, - and _ with a digit in it, "
            f"such as P01; names are not kept, got {text!r}"
        )
    return text
