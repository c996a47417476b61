"""What several commands share: arguments, options, and how a result is printed."""

from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from protocol.address import checked_address
from protocol.errors import BadInput

if TYPE_CHECKING:
    from runner.journal.store import Journal
    from runner.study.folder import StudyFolder


class Ratings(StrEnum):
    """Who answers."""

    window = "window"
    console = "console"
    virtual = "virtual"


class Pace(StrEnum):
    """How time passes."""

    wall = "wall"
    stepped = "stepped"


class Format(StrEnum):
    """How data are handed on."""

    csv = "csv"
    bids = "bids"
    psychds = "psychds"


class Wire(StrEnum):
    """How the simulated device is reached."""

    pty = "pty"
    tcp = "tcp"


class Dialect(StrEnum):
    """What the simulated device speaks."""

    board = "board"
    keysight = "keysight"
    keysight_33220a = "keysight-33220A"


class Law(StrEnum):
    """A friction law."""

    printed = "printed"
    consistent = "consistent"
    coulomb = "coulomb"


class Overlap(StrEnum):
    """Which pieces of Eq 15 hold where two overlap."""

    first = "first"
    last = "last"


def _languages() -> Iterable[str]:
    from protocol.study.languages import built_in_codes

    return built_in_codes()


_CHOICES: Mapping[str, Callable[[], Iterable[str]]] = {"language": _languages}
"""What there is to choose from, by the parameter; the lists stand where they are used."""


class Choosing(TyperCommand):
    """A command whose help lists choices, which are looked up for it alone."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options as every command does, with the choices there are."""
        for parameter in self.params:
            if parameter.name in _CHOICES:
                parameter.metavar = f"<{'|'.join(_CHOICES[parameter.name]())}>"
        super().format_options(ctx, formatter)


def named_folder(text: str) -> Path:
    """Return the folder of that name; no name is no folder, although Path takes it for this one."""
    if not text.strip():
        raise typer.BadParameter(f"must name a folder, got {text!r}")
    return Path(text)


StudyArgument = Annotated[Path, typer.Argument(metavar="STUDY", help="The study's folder.")]


def address(given: str | None) -> str | None:
    """Return the address of a device, if one is given; refuse what cannot be one."""
    return None if given is None else checked_address(given)


UrlArgument = Annotated[
    str,
    typer.Argument(
        metavar="URL", help="A serial port, socket://HOST:PORT, or sim.", callback=address
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document instead.")]


ParticipantOption = Annotated[str, typer.Option(help="The pseudonym.")]
SessionOption = Annotated[int, typer.Option(min=1)]


def _reason(given: str) -> str | None:
    if not given.strip():
        raise BadInput("--reason must say why, got nothing")
    return _text(given)


def _text(given: str | None) -> str | None:
    """Refuse bytes that are no text: nothing else can be written into the journal."""
    try:
        return given if given is None else given.encode().decode()
    except UnicodeEncodeError:
        raise BadInput(f"a text must be UTF-8, got {given!r}") from None


ConsentOption = Annotated[
    str | None, typer.Option(help="Reference of the signed consent.", callback=_text)
]
ReasonOption = Annotated[
    str, typer.Option(help="Why; it is written into the journal.", callback=_reason)
]


def print_json(document: object) -> None:
    """Print `document` as the one JSON document of a command."""
    import json

    typer.echo(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))


def study_journal(folder: "StudyFolder", *, to_write: bool = False) -> "Journal":
    """Return the journal of a study that has one."""
    from runner.journal.store import open_journal, read_journal

    path = folder.existing_journal()
    return open_journal(path) if to_write else read_journal(path)
