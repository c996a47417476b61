"""The application: all commands, and errors as one line."""

import inspect
import os
import sys
from collections.abc import Iterator
from importlib import import_module
from io import TextIOWrapper
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from runner.signals import signals_raise
from touchbeam.cli.output import WORK_FAILED, complain_of, say, warnings_in_lines

_MODULES = ("study", "slide", "sharing", "results", "power", "journal", "device", "documentation")
"""Where the commands are, in the order in which help lists them."""


class _OnDemand(TyperGroup):
    """All commands, of which the one that is called is imported and built alone.

    Reading the parameters of all would take longer than the rest of `--help`.
    """

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - typer's own has it
        """Return the names of all commands, in the order of help."""
        return [name for name, _, _ in _all_commands()]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of that name; None if there is none."""
        for name, _, alone in _all_commands():
            if name == cmd_name:
                return typer.main.get_command(alone)
        self.commands.update(_in_brief())  # typer suggests those whose names are nearly alike
        return super().get_command(ctx, cmd_name)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of commands, which needs the first sentence of each alone."""
        TyperGroup(commands=_in_brief()).format_commands(ctx, formatter)


def _all_commands() -> Iterator[tuple[str, Any, typer.Typer]]:
    """Yield name, description and application of each, whose module is imported when it comes."""
    for module in _MODULES:
        part: Any = import_module(f"touchbeam.cli.{module}").app
        for command in part.registered_commands:
            alone = typer.Typer(add_completion=False, rich_markup_mode=None)
            alone.registered_commands = [command]
            yield command.name or command.callback.__name__, command, alone
        for group in part.registered_groups:
            yield group.name, group.typer_instance.info, group.typer_instance


def _in_brief() -> dict[str, Any]:
    return {
        name: TyperCommand(
            name, help=info.help or inspect.getdoc(info.callback), hidden=info.hidden
        )
        for name, info, _ in _all_commands()
    }


app = typer.Typer(
    name="touchbeam",
    cls=_OnDemand,
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


def main() -> None:
    """Run the command line; report an error as one line on standard error.

    Exit codes: 0 done, 1 the work failed, 2 wrong usage or bad input.
    """
    # The search for pydantic plugins reads the metadata of every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    # With one thread, sums are in the same order on every computer: the same input, same bytes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # An old code page, as of a pipe on Windows, lacks letters, which must not end a session.
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
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
