"""A study on disk: its file, its journal, and what is made from them."""

import os
import re
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from protocol.errors import BadInput
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study

_PSEUDONYM = re.compile(r"(?=.*[0-9])[A-Za-z0-9][A-Za-z0-9_-]{0,31}")


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

    def text(self) -> str:
        """Return the text of the study file.

        Raises:
            BadInput: there is none.
        """
        try:
            return self.study_file.read_text(encoding="utf-8-sig")
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
        return parsed_study(self.text(), str(self.study_file))

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
    topmost = _made(folder.path)
    try:
        folder.study_file.write_text(text, encoding="utf-8")
        yield folder
    except BaseException:
        from runner.journal.store import unused

        if unused(folder.journal):
            _take_away([topmost] if topmost else folder.path.iterdir())
        raise


def _made(given: Path) -> Path | None:
    """Make the folder `given` and what is missing above it; return the topmost one made, if any.

    What to take away again is known only of the folder that is really meant: where `..` and links
    lead is found out first.
    """
    path = Path(os.path.realpath(given))
    missing = [path, *(parent for parent in path.parents if not parent.exists())]
    try:
        path.mkdir(mode=0o700, parents=True)
    except FileExistsError:
        _require_empty(path)
        return None
    except OSError as error:
        if missing[-1].exists() and missing[-1] != path:
            shutil.rmtree(missing[-1])
        raise BadInput(f"{path}: cannot be made ({error.strerror}); name another folder") from error
    return missing[-1]


def _require_empty(path: Path) -> None:
    try:
        taken = any(path.iterdir())
    except OSError as error:
        raise BadInput(f"{path}: no folder for a study ({error.strerror}); name another") from error
    if taken:
        raise BadInput(f"{path}: is there already and not empty; name a new folder")


def _take_away(paths: Iterable[Path]) -> None:
    for path in list(paths):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


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
