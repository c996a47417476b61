"""Everything that the commands print: lines, JSON, tables, progress bars and error lines.

No other module prints, but for what a rig says to its own program (`touchbeam/held_rigs.py`), so
nothing reaches a terminal unescaped.
"""

import errno
import gc
import shutil
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import typer

from protocol.errors import BadInput, WorkFailed, shown, typed_as
from runner.people.terminal import at_terminal, visible, visible_json

# Columns of a table in a pipe: programs and searches find each cell whole.
WIDE = 10_000


def say(line: str) -> None:
    """Print `line` on standard output."""
    typer.echo(visible(line))


def complain(line: str) -> None:
    """Print `line` on standard error."""
    typer.echo(visible(line), err=True)


def program() -> str:
    """Return how touchbeam was started, as its next command can be typed."""
    started, on_path = Path(sys.argv[0]), shutil.which("touchbeam")
    if started.name == "__main__.py" and on_path is None:
        return f"{typed_as(sys.executable)} -m touchbeam"
    elsewhere = started.stem == "touchbeam" and started.parent != Path()
    if not elsewhere or (on_path and started.exists() and started.samefile(on_path)):
        return "touchbeam"
    return typed_as(sys.argv[0])


_DECIMALS = {"V": 2, "Hz": 0, "N": 3, "m": 4, "s": 2, "ms": 1, "°C": 1, "Ω": 0}
_UNITS = {"v": "V", "hz": "Hz", "n": "N", "m": "m", "s": "s", "ms": "ms", "c": "°C", "ohm": "Ω"}
"""Units by the end of a name such as `monitor_v`."""


def quantity(value: float, unit: str) -> str:
    """Return a quantity as people read it: few digits, thousands apart, and the unit.

    >>> quantity(24068.4, "Hz"), quantity(0.0618, "V"), quantity(-0.0001, "N")
    ('24 068 Hz', '0.06 V', '0 N')
    """
    text = f"{value:,.{_DECIMALS[unit]}f}".replace(",", " ")
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return f"{'0' if text in {'-0', ''} else text} {unit}"


def named_quantity(name: str, value: object) -> tuple[str, str]:
    """Return the name without its unit, and the value with it, if the name ends in one.

    >>> named_quantity("monitor_v", "0.06181288801")
    ('monitor', '0.06 V')
    """
    stem, _, ending = name.rpartition("_")
    if not stem or ending not in _UNITS:
        return name.replace("_", " "), str(value)
    try:
        shown = quantity(float(str(value)), _UNITS[ending])
    except ValueError:
        shown = f"{value} {_UNITS[ending]}"
    return stem.replace("_", " "), shown


def counted(number: int, what: str) -> str:
    """Return a number of things in words.

    >>> counted(1, "session"), counted(2, "session")
    ('1 session', '2 sessions')
    """
    return f"{number} {what}{'' if number == 1 else 's'}"


_BARS = "▁▂▃▄▅▆▇█"


def bars(values: Sequence[float]) -> str:
    """Return a line of bars, each as high as its value relative to the largest.

    >>> bars([0.0, 1.0, 2.0])
    '▁▅█'
    """
    top = max(values, default=0.0) or 1.0
    return "".join(_BARS[round(max(value, 0.0) / top * (len(_BARS) - 1))] for value in values)


def require_confirmation(fact: str, option: str) -> None:
    """Ask on the terminal whether `fact` is meant; if not, raise `BadInput` with the `option`."""
    # A question that goes into a file would wait for ever, and a pipe is nobody's answer.
    if not at_terminal(sys.stdin, sys.stderr):
        raise BadInput(f"{fact}; {option}")
    complain(f"touchbeam: {fact}.")
    # On standard error, so that standard output has only what the command gives.
    typer.echo("Go on? [y/N] ", nl=False, err=True)
    if sys.stdin.readline().strip().lower() not in {"y", "yes"}:
        raise BadInput(f"nothing was done; {option}")


def print_json(document: object) -> None:
    """Print `document` as the only JSON document of a command."""
    import json

    # No NaN, because JSON has none: programs that read it would fail.
    print_json_text(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))


def print_json_text(text: str) -> None:
    """Print a JSON document."""
    typer.echo(visible_json(text.removesuffix("\n")))


def print_csv(text: str) -> None:
    """Print a CSV file: exactly to a pipe or file, visibly on a terminal."""
    if not at_terminal(sys.stdout):
        typer.echo(text, nl=False)
        return
    for line in text.removesuffix("\n").split("\n"):
        say(line)


@contextmanager
def warnings_in_lines() -> Iterator[None]:
    """Print warnings of libraries in the body as lines on standard error."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, category, *_: complain(
            f"touchbeam: warning: {message}{_computing(category)}"
        )
        yield


def _computing(category: type[Warning]) -> str:
    """Return what was computed when numpy warned of a number, and what that means for results."""
    # The warning itself tells only the line in numpy; ours is further up.
    frame = sys._getframe() if issubclass(category, RuntimeWarning) else None
    while frame and not frame.f_globals["__name__"].startswith(("analysis.", "device.")):
        frame = frame.f_back
    if frame is None:
        return ""
    module = frame.f_globals
    return (
        f" in {module['__name__']}, line {frame.f_lineno}; what it computes may be wrong or "
        f"missing: {(module['__doc__'] or '').partition(chr(10))[0]}"
    )


def print_table(title: str, lines: Sequence[Sequence[str]]) -> None:
    """Print `lines`: a header, rows, and a last row as the footer."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    def shown(text: str) -> str:
        # Names from a study file may hold what rich takes for markup.
        return escape(visible(text))

    header, *rows, last = lines
    table = Table(
        title=shown(title),
        box=box.SIMPLE_HEAD,
        show_footer=True,
        title_justify="left",
        padding=0,
    )
    for place, (name, foot) in enumerate(zip(header, last, strict=True)):
        table.add_column(shown(name), shown(foot), justify="right" if place else "left")
    for row in rows:
        table.add_row(*(shown(cell) for cell in row))
    # A pipe has no width. Where TERM is dumb, rich uses the given width only if a height is given.
    console = Console() if at_terminal(sys.stdout) else Console(width=WIDE, height=1)
    console.print(table)


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a progress bar on a terminal; yield a function to call after each of `total` steps."""
    if not at_terminal(sys.stderr):
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(visible(what), total=total)
        yield lambda: bar.advance(task)


_T = TypeVar("_T")


def followed(what: str, items: Iterable[_T], total: int, *, alone: bool = False) -> Iterator[_T]:
    """Yield `items`, with a progress bar on a terminal unless a document is to be `alone`."""
    if alone:
        yield from items
        return
    with progress(what, total) as step:
        for item in items:
            yield item
            step()


def collect_rarely() -> None:
    """Look for cycles of objects rarely: in a command in which nobody waits for the next moment.

    Each search then takes 5 ms, which a session could not spare, but all of them together less.
    """
    gc.set_threshold(100_000, 20, 20)


WORK_FAILED = 1
BAD_INPUT = 2

_PATHS_GIVEN_WRONG = {
    errno.EACCES,
    errno.EEXIST,
    errno.EISDIR,
    errno.ELOOP,
    errno.ENAMETOOLONG,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EPERM,
}


def complain_of(error: BaseException, *, debug: bool) -> int:
    """Print the error line, or the traceback if `debug`; return the exit code."""
    if debug:
        import traceback

        for part in "".join(traceback.format_exception(error)).splitlines():
            complain(part)
        return WORK_FAILED
    line, code = complaint(error)
    complain(f"touchbeam: {line}")
    return code


def complaint(error: BaseException) -> tuple[str, int]:
    """Return the error line for the user and the exit code."""
    line, code = _line(error)
    # A device's error may say "output off, read back" already.
    notes = [note for note in getattr(error, "__notes__", ()) if note not in line]
    # One line, whatever line feeds an error of a library contains.
    return " ".join("; ".join([line, *notes]).split()), code


_OWN_WORDS = (
    ("Value error, ", ""),
    (", unable to parse string as an integer", ""),
    (", unable to parse string as a number", ""),
    ("Input should be a valid integer", "must be a whole number"),
    ("Input should be a valid number", "must be a number"),
    ("Input should be greater than or equal to", "must be at least"),
    ("Input should be less than or equal to", "must be at most"),
    ("Input should be", "must be"),
)
"""The words of the library that reads options, and ours."""


def _own_words(message: str, cause: BaseException | None = None) -> str:
    """Return what the library says about an option, in our words, and the value that was given.

    >>> _own_words("Invalid value for '--session': Input should be greater than or equal to 1")
    "Invalid value for '--session': must be at least 1"
    """
    for theirs, ours in _OWN_WORDS:
        message = message.replace(theirs, ours)
    refused: Any = getattr(cause, "errors", list)()
    given = str(refused[0]["input"]) if refused else ""
    return message if given in message else f"{message}, got {shown(given)}"


def _line(error: BaseException) -> tuple[str, int]:
    match error:
        case typer.TyperException():
            of = getattr(getattr(error, "ctx", None), "command_path", "touchbeam")
            said = _own_words(error.format_message(), error.__cause__)
            return f"{said} (see {of} --help)", error.exit_code
        case BadInput():
            return str(error), BAD_INPUT
        case WorkFailed():
            return str(error), WORK_FAILED
        case OSError(filename=str() as path, strerror=str() as why):
            # A wrong path is the user's to correct; a full disk is not wrong input.
            code = BAD_INPUT if error.errno in _PATHS_GIVEN_WRONG else WORK_FAILED
            return f"{path}: {why}", code
        # Without a file name it is standard output's, which may lead to a file on a full disk.
        case OSError(errno=errno.ENOSPC | errno.EFBIG | errno.EDQUOT, strerror=str() as why):
            return f"cannot write to standard output ({why})", WORK_FAILED
    return (
        f"internal error, {type(error).__name__}: {error} (--debug shows the traceback)",
        WORK_FAILED,
    )
