"""Arguments and options shared by several commands."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import typer
from typer.core import TyperCommand

from protocol.address import checked_address
from protocol.errors import BadInput, page
from touchbeam.cli.output import complain

if TYPE_CHECKING:
    from device.beam.eq15 import Overlap
    from device.people.person import Population
    from runner.journal.store import Journal
    from runner.screens import AnswerSource
    from runner.study.folder import StudyFolder
else:  # typer evaluates annotations at run time
    AnswerSource = Overlap = str

Wire = Literal["pty", "tcp"]
"""Transport of the simulated device."""


def _named(module: str, name: str) -> Any:
    return getattr(import_module(module), name)


_CHOICES: Mapping[str, Callable[[], Iterable[str]]] = {
    "language": lambda: (*_named("protocol.study.languages", "built_in_codes")(), "CODE"),
    "template": lambda: _named("protocol.study_file.loading", "TEMPLATES"),
    "dialect": lambda: tuple(_named("device.simulator.device", "dialects")()),
    "law": lambda: _named("device.friction.laws", "LAWS"),
    "eq15_overlap": lambda: get_args(_named("device.beam.eq15", "Overlap")),
    "as_format": lambda: _named("analysis.export.formats", "EXPORTS"),
    "shape": lambda: get_args(_named("analysis.thresholds.answer_curve", "Shape")),
    "encoding": lambda: get_args(_named("analysis.tables.separated", "Encoding")),
    "decimal": lambda: get_args(_named("analysis.tables.table_cells", "Decimal")),
    "ratings": lambda: get_args(_named("runner.screens", "AnswerSource")),
}
"""Choices by parameter. A look-up imports the module that defines them."""


class Choosing(TyperCommand):
    """A command that lists its choices in help and errors, and looks them up only then."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        for parameter in self._choices():
            # Typer asks for this text only if an option is missing; no choice is looked up before.
            vars(parameter)["get_missing_message"] = partial(_choose_from, parameter.name)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options with their choices."""
        for parameter in self._choices():
            parameter.metavar = f"<{'|'.join(_CHOICES[parameter.name]())}>"
        super().format_options(ctx, formatter)

    def _choices(self) -> list[Any]:
        return [parameter for parameter in self.params if parameter.name in _CHOICES]


def _choose_from(parameter: str, ctx: object) -> str:  # noqa: ARG001 - typer's own has it
    return f"Choose from: {', '.join(_CHOICES[parameter]())}"


def _chosen(parameter: str, told: str, *names: str) -> Any:
    """Return an option that accepts only the parameter's choices."""

    def parsed(given: str) -> str:
        known = tuple(_CHOICES[parameter]())
        if given not in known:
            raise ValueError(f"{given!r} is not one of {', '.join(map(repr, known))}.")
        return given

    return typer.Option(*names, parser=parsed, help=told)


LanguageOption = Annotated[
    str | None, typer.Option(help="CODE: one of the study's own. [default: the study's]")
]
"""Not checked here, because a study may have its own languages."""
TemplateOption = Annotated[str, _chosen("template", "Built-in study to start from.")]
DialectOption = Annotated[str, _chosen("dialect", "The device's command set.")]
LawOption = Annotated[str, _chosen("law", "Friction law.")]
SimulatedLawOption = Annotated[
    str | None,
    _chosen("law", "Friction of the simulated beam. [default: the report's law]", "--law"),
]


def _rung(name: str) -> str:
    from device.friction.rungs import rung_named

    return rung_named(name)


SimulatedRungOption = Annotated[
    str | None,
    typer.Option(
        "--rung",
        parser=_rung,
        metavar="RUNG",
        help="Motion of the simulated beam: a rung of `touchbeam ladder`. "
        "[default: the report's rung]",
    ),
]


def _damping(given: str) -> float:
    with suppress(ValueError):
        if 0 < float(given) < 1:
            return float(given)
    raise ValueError("must lie strictly between 0 and 1")


SimulatedDampingOption = Annotated[
    float | None,
    typer.Option(
        "--damping",
        parser=_damping,
        metavar="RATIO",
        help="Damping ratio of the simulated beam. [default: near 0.005, from the seed]",
    ),
]
PeopleOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Virtual people: one person, or a population to draw from; see "
        + page("Virtual people"),
    ),
]
OverlapOption = Annotated[
    Overlap, _chosen("eq15_overlap", "Piece of Eq 15 that applies where two overlap.")
]
RatingsOption = Annotated[
    AnswerSource, _chosen("ratings", "Where the participant answers; virtual: a program does.")
]


def _fit_task(given: str) -> str:
    from analysis.thresholds.psychometric import guess_rate

    guess_rate(given)
    return given


def _guess(given: str) -> float | str:
    with suppress(ValueError):
        return float(given)
    if given == "free":
        return given
    raise ValueError("must be a number from 0 to 0.9, or free")


TaskOption = Annotated[
    str | None,
    typer.Option(
        "--task",
        parser=_fit_task,
        metavar="TASK",
        help="What was asked: yes or no (correct is yes), two intervals, three intervals, or 2AFC, "
        "3AFC, 4AFC, ... [default: the study's, or two intervals]",
    ),
]
GuessOption = Annotated[
    Any,
    typer.Option(
        "--guess",
        parser=_guess,
        metavar="RATE",
        help="The guess rate, or free to estimate it. [default: the task's]",
    ),
]
ShapeOption = Annotated[
    str, _chosen("shape", "The curve: normal in levels, weibull in their logarithm.")
]
FormatOption = Annotated[
    str, _chosen("as_format", "csv: tidy tables; the others: data sets for archives.", "--format")
]


EncodingOption = Annotated[
    str | None, _chosen("encoding", "Of a file of text. [default: utf-8, or utf-16 if it looks so]")
]
DecimalOption = Annotated[
    str | None, _chosen("decimal", "The mark in numbers. [default: as they tell]")
]


def named_folder(text: str) -> Path:
    """Return the folder `text`; refuse a blank name, which Path takes for the current folder."""
    if not text.strip():
        raise typer.BadParameter(f"must name a folder, got {text!r}")
    return Path(text)


StudyArgument = Annotated[Path, typer.Argument(metavar="STUDY", help="The study's folder.")]
StudyOrBackupArgument = Annotated[
    Path, typer.Argument(metavar="STUDY", help="The study's folder, or a backup of its journal.")
]


def text(given: str | None) -> str | None:
    """Refuse text that is not valid UTF-8: the journal cannot store it."""
    try:
        # Python turns an argument that is not UTF-8 into halves of characters.
        return given if given is None else given.encode().decode()
    except UnicodeEncodeError:
        raise BadInput(f"text must be valid UTF-8, got {given!r}") from None


def address(given: str | None) -> str | None:
    """Return the checked address of a device, or None if none is given."""
    text(given)
    return None if given is None else checked_address(given)


UrlArgument = Annotated[
    str,
    typer.Argument(
        metavar="URL", help="A serial port, socket://HOST:PORT, or sim.", callback=address
    ),
]
DeviceOption = Annotated[
    str | None,
    typer.Option(
        help="A serial port, socket://HOST:PORT, or sim. [default: the study's]", callback=address
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
RehearsalsOption = Annotated[
    bool, typer.Option("--rehearsals", help="Include rehearsals, marked as such.")
]
SessionOption = Annotated[int, typer.Option(min=1)]
TrialOption = Annotated[
    int | None, typer.Option(min=0, help="The trial's index. [default: the whole session]")
]
OfRehearsalOption = Annotated[
    bool, typer.Option("--rehearsal", help="The rehearsal of that name, not the session.")
]


def columns_option(told: str) -> Any:
    """Return the option that says what the columns of a table are."""
    return typer.Option("--columns", metavar="ROLE=NAME,…", help=told, callback=text)


MissingOption = Annotated[
    str | None,
    typer.Option(
        metavar="WORD,…",
        help="What stands for no value, beside blanks, NA, n/a, NaN, - and .",
        callback=text,
    ),
]
SheetOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="A sheet of a workbook.", callback=text)
]


def _reason(given: str) -> str | None:
    if not given.strip():
        raise BadInput("--reason must not be blank")
    return text(given)


ParticipantOption = Annotated[str, typer.Option(help="The pseudonym.", callback=text)]
ConsentOption = Annotated[
    str | None, typer.Option(help="Reference of the signed consent form.", callback=text)
]
ReasonOption = Annotated[
    str, typer.Option(help="The reason, recorded in the journal.", callback=_reason)
]


def study_folder(path: Path) -> "StudyFolder":
    """Return the study in the folder `path`, after a line on what is ignored in its file."""
    from runner.study.folder import StudyFolder

    folder = StudyFolder(path=path)
    with suppress(BadInput):  # who reads the study says what is wrong with it
        if ignored := folder.ignored():
            complain(f"touchbeam: warning: {folder.study_file}: ignored: {ignored}")
    return folder


def study_journal(folder: "StudyFolder", *, to_write: bool = False) -> "Journal":
    """Open the journal of the study; raises `BadInput` if nothing has been recorded yet."""
    from runner.journal.opening import open_journal, read_journal

    path = folder.existing_journal()
    return open_journal(path) if to_write else read_journal(path)


def people_in_file(path: Path) -> "Population":
    """Return the virtual people that the file describes; raises `BadInput`, a line a problem."""
    from device.people.people_file import people_in
    from runner.study.files import short_text

    return people_in(short_text(path), str(path))
