"""What several commands share: arguments, options, and how a result is printed."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import typer
from typer.core import TyperCommand

from protocol.address import checked_address
from protocol.errors import BadInput

if TYPE_CHECKING:
    from device.beam.eq15 import Overlap
    from runner.journal.store import Journal
    from runner.study.folder import StudyFolder
else:  # what typer reads
    Overlap = str

Wire = Literal["pty", "tcp"]
"""How the simulated device is reached."""


def _languages() -> Iterable[str]:
    from protocol.study.languages import built_in_codes

    return built_in_codes()


def _simulated_dialects() -> Iterable[str]:
    from device.simulator.device import dialects

    return dialects()


def _laws() -> Iterable[str]:
    from device.friction.laws import LAWS

    return LAWS


def _overlaps() -> Iterable[str]:
    from device.beam.eq15 import Overlap

    return get_args(Overlap)


def _formats() -> Iterable[str]:
    from analysis.export.formats import EXPORTS

    return EXPORTS


_CHOICES: Mapping[str, Callable[[], Iterable[str]]] = {
    "language": _languages,
    "dialect": _simulated_dialects,
    "law": _laws,
    "eq15_overlap": _overlaps,
    "as_format": _formats,
}
"""What there is to choose from, by the parameter. Looking it up loads what defines it."""


class Choosing(TyperCommand):
    """A command that says which choices there are, and looks them up only then."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        for parameter in self._choices():
            vars(parameter)["get_missing_message"] = partial(_choose_from, parameter.name)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options as every command does, with the choices there are."""
        for parameter in self._choices():
            parameter.metavar = f"<{'|'.join(_CHOICES[parameter.name]())}>"
        super().format_options(ctx, formatter)

    def _choices(self) -> list[Any]:
        return [parameter for parameter in self.params if parameter.name in _CHOICES]


def _choose_from(parameter: str, ctx: object) -> str:  # noqa: ARG001 - typer's own has it
    return f"Choose from: {', '.join(_CHOICES[parameter]())}"


def _one_of(parameter: str) -> Callable[[str], str]:
    """Return a parser that refuses what is none of the parameter's choices."""

    def parsed(given: str) -> str:
        known = tuple(_CHOICES[parameter]())
        if given not in known:
            raise ValueError(f"{given!r} is not one of {', '.join(map(repr, known))}.")
        return given

    return parsed


LanguageOption = Annotated[str, typer.Option()]
"""Not checked here: a study may have languages of its own."""
DialectOption = Annotated[str, typer.Option(parser=_one_of("dialect"), help="What it speaks.")]
LawOption = Annotated[str, typer.Option(parser=_one_of("law"))]
OverlapOption = Annotated[
    Overlap, typer.Option(parser=_one_of("eq15_overlap"), help="For the printed law.")
]
FormatOption = Annotated[
    str, typer.Option("--format", parser=_one_of("as_format"), help="csv is one tidy table.")
]


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
