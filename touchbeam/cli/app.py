"""The application: all commands, and errors as one line."""

import os
import sys
from typing import Annotated

import typer

from runner.signals import signals_raise
from touchbeam.cli import device, journal, power, results, sharing, slide, study
from touchbeam.cli.output import WORK_FAILED, complain_of, say, warnings_in_lines

app = typer.Typer(
    name="touchbeam",
    help="Psychophysics experiments on touch devices whose friction is changed by vibration.",
    epilog="Every command takes --debug, which shows the traceback of an error.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        say(f"touchbeam {version('touchbeam')}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_print_version, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass


for commands in (study, slide, sharing, results, power, journal, device):
    app.add_typer(commands.app)


def main() -> None:
    """Run the command line; report an error as one line on standard error.

    Exit codes: 0 done, 1 the work failed, 2 wrong usage or bad input.
    """
    # The search for pydantic plugins reads the metadata of every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    # With one thread, sums are in the same order on every computer: the same input, same bytes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Taken out here, so that it works at any place and also if the command line itself is wrong.
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    debug = len(arguments) < len(sys.argv) - 1
    try:
        with signals_raise(), warnings_in_lines():
            # Not standalone: typer would print errors in its own form and end the process.
            code = app(arguments or ["--help"], prog_name="touchbeam", standalone_mode=False)
            _flush()
    except Exception as error:
        code = complain_of(error, debug=debug)
    try:
        _flush()
    except OSError:
        # Python would try again when it ends, and replace the exit code by 120.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = code or WORK_FAILED
    sys.exit(code or 0)


def _flush() -> None:
    if sys.stdout is not None:  # it is None where the shell closed it (`>&-`)
        sys.stdout.flush()
