"""Reference pages written from the code: `python -m handbook.reference` writes them anew.

Commands with their options, the columns of tables, the Python package, the statistics with formula
and source, the faults that can be simulated, the journal's events, and virtual people's parameters.
"""

import inspect
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup
from typer.testing import CliRunner

import touchbeam
from device.simulator.faults import FAULTS
from handbook.build import ROOT
from handbook.columns import columns_page
from handbook.events import event_list
from handbook.people import parameters_page
from touchbeam.cli.app import app

FOLDER = ROOT / "docs" / "reference"

_STATISTICS = {
    "Differences between conditions": (
        "statistics.omnibus.friedman",
        "statistics.omnibus.skillings_mack",
        "statistics.omnibus.exact_p",
        "statistics.omnibus.monte_carlo_p",
        "statistics.signed_rank.signed_rank",
        "statistics.signed_rank.pairwise_signed_ranks",
        "statistics.corrections.holm",
        "loading.response.responses",
        "statistics.slope.slope",
        "statistics.slope.level_slope",
    ),
    "Sizes of effects and agreement": (
        "statistics.intervals.mean_interval",
        "statistics.intervals.rank_biserial_interval",
        "statistics.intervals.concordance_interval",
    ),
    "Groups, factors and detection": (
        "statistics.groups.two_groups",
        "statistics.groups.compared",
        "statistics.groups.interaction",
        "statistics.factorial.within_effect",
        "statistics.factorial.cell_intervals",
        "statistics.detection.detection",
        "statistics.detection.noticed_p",
    ),
    "Thresholds": (
        "thresholds.psychometric.fitted",
        "thresholds.curve_mode.highest_density",
        "thresholds.curve_posterior.posterior",
        "thresholds.psychometric.mixed",
    ),
    "Sensitivity of each person": (
        "sensitivity.answers_model.sensitivity",
        "sensitivity.noticing_stage.noticing_stage",
        "sensitivity.rating_stage.rating_stage",
        "sensitivity.lines.log_prior_of_spread",
    ),
}


def commands_page() -> str:
    """Return the page of all commands: what `--help` says of each."""
    sections = "\n".join(_help_of(path) for path in _commands(typer.main.get_command(app), ()))
    return (
        "# Commands\n\nThis page is written from the program by `python -m handbook.reference`. "
        "`touchbeam COMMAND --help` shows\nthe same. Every command takes `--debug`, which shows "
        "the traceback of an error.\n\nExit code 0 means that all is well, 1 that the work failed, "
        f"2 wrong usage or bad input. An error is one line on\nstandard error.\n\n{sections}"
    )


def _commands(command: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield the words of each command below this one."""
    if not isinstance(command, TyperGroup):
        yield path
        return
    for name in command.list_commands(None):  # type: ignore[arg-type] # no command is run
        yield from _commands(command.get_command(None, name), (*path, name))  # type: ignore[arg-type]


def _help_of(path: tuple[str, ...]) -> str:
    said = CliRunner().invoke(app, [*path, "--help"], prog_name="touchbeam", terminal_width=100)
    return f"## `touchbeam {' '.join(path)}`\n\n```text\n{said.output.strip()}\n```\n"


def python_page() -> str:
    """Return the page of the package `touchbeam`."""
    parts = [
        "# The Python package\n\nThis page is written from the package by `python -m "
        "handbook.reference`. [touchbeam in Python](../python.md) shows\nhow it is used. Only what "
        "stands here is meant to be used from outside.\n"
    ]
    for name in sorted(touchbeam.__all__, key=lambda name: (name[0].isupper(), name)):
        thing = getattr(touchbeam, name)
        if callable(thing) and not inspect.isclass(thing):
            parts.append(_callable_section(f"touchbeam.{name}", thing))
    for kind, called in ((touchbeam.Study, "study"), (touchbeam.OpenRig, "rig")):
        parts += [f"## `touchbeam.{kind.__name__}`\n\n{_prose(kind)}\n", *_members(kind, called)]
    return "\n".join(parts)


def _members(kind: type, called: str) -> Iterator[str]:
    for name, member in vars(kind).items():
        if name.startswith("_") or not getattr(member, "__doc__", None):
            continue
        if isinstance(member, property):
            yield f"### `{called}.{name}`\n\n{_prose(member)}\n"
        elif hasattr(member, "func"):
            yield f"### `{called}.{name}`\n\n{_prose(member.func)}\n"
        elif callable(member):
            yield _callable_section(f"{called}.{name}", member, level="###")


def _callable_section(name: str, thing: Callable[..., Any], level: str = "##") -> str:
    signature = inspect.signature(thing)
    parameters = [p for p in signature.parameters.values() if p.name != "self"]
    shown = str(signature.replace(parameters=parameters)).replace("'", "").replace('"', "")
    short = name.rpartition(".")[2]
    return f"{level} `{name}`\n\n```text\n{short}{shown}\n```\n\n{_prose(thing)}\n"


def _prose(thing: Any) -> str:
    """Return the docstring as Markdown; indented lists below a heading become items."""
    text = inspect.getdoc(thing) or ""
    text = re.split(r"\n\n(?=>>>)", text)[0]
    lines = []
    for line in text.splitlines():
        if re.fullmatch(r"(Args|Parameters|Raises|Returns|Yields):", line):
            lines += [f"**{line[:-1]}**", ""]
        elif re.match(r" {4}\S", line):
            lines.append(f"- {line.strip()}")
        else:
            lines.append(line if not line.startswith("        ") else f"  {line.strip()}")
    return "\n".join(lines)


def statistics_page() -> str:
    """Return the page of the statistics, with the formula and the source of each."""
    parts = [
        "# Statistics\n\nThis page is written from the program by `python -m handbook.reference`: "
        "formula and source of each statistic of\nthe report, as they stand beside the code. [The "
        "report](../report.md) says when each is used and how to read it. Numbers in brackets are\n"
        "equations of the mathematics: [responses and factors](../mathematics/response.md), "
        "[groups](../mathematics/groups.md), [rank tests](../mathematics/rank-tests.md),\n"
        "[detection](../mathematics/detection.md), "
        "[thresholds](../mathematics/thresholds.md), [answers](../mathematics/answers.md), "
        "[their model's engine](../mathematics/sensitivity.md).\n"
    ]
    for title, names in _STATISTICS.items():
        parts.append(f"## {title}\n")
        for name in names:
            module, _, function = f"analysis.{name}".rpartition(".")
            thing = getattr(import_module(module), function)
            parts.append(f"### {_words(function)}\n\n{_formulae(thing)}\n")
            parts.append(f"`{module.replace('.', '/')}.py`\n")
    return "\n".join(parts)


def _words(name: str) -> str:
    known = {
        "friedman": "Friedman's test",
        "skillings_mack": "Skillings-Mack test",
        "exact_p": "Exact permutation p",
        "monte_carlo_p": "Permutation p from random shufflings",
        "holm": "Holm's correction",
        "responses": "Response of a trial",
        "slope": "Slope of responses on predicted contrasts",
        "level_slope": "Slope within conditions",
        "sensitivity": "Model of the answers",
        "noticing_stage": "Noticing of changes",
        "rating_stage": "Rating of changes",
        "compared": "Any number of groups compared",
        "interaction": "Group × condition",
        "within_effect": "Effect of a factor, or of an interaction",
        "detection": "d′ and criterion",
        "noticed_p": "Noticed more than on catch trials",
        "fitted": "Threshold, slope and lapse rate of a table of answers",
        "posterior": "Posterior of a curve",
        "mixed": "Mixed model of a cohort's thresholds",
    }
    return known.get(name, name.replace("_", " ").capitalize())


def _formulae(thing: Any) -> str:
    """Return what the docstring says of the quantity, without parameters and errors."""
    text = inspect.getdoc(thing) or ""
    text = re.split(r"\n\n(?=>>>|Args:|Parameters:|Raises:)", text)[0]
    # A backslash within a code span would be shown.
    text = re.sub(r"(`[^`]*`)|([*_])", lambda it: it[1] or f"\\{it[2]}", text)
    text = text.removeprefix("Return ").removeprefix("the ")
    return text[0].upper() + text[1:]


_ON_THE_HOST = {
    19: "the host is killed or stopped with the output on",
    22: "a second program opens the port",
    26: "Ctrl-C, SIGTERM or a closed window in the middle of a ramp",
    29: "the port comes back (`vanish`, off)",
    30: "two tasks ask at once",
    33: "a port that is missing, forbidden, no port, or of an unknown scheme",
}


def faults_page() -> str:
    """Return the page of the faults: those of the simulated device, and the host's."""
    simulated = [(fault.number, f"`{fault.name}`: {fault.what}") for fault in FAULTS]
    listed = sorted([*simulated, *_ON_THE_HOST.items()], key=lambda entry: entry[0])
    rows = "\n".join(f"- {number} {what}" for number, what in listed)
    return (
        "# Faults\n\nThis page is written from the program by `python -m handbook.reference`. "
        "`fault NAME on` at the control\nsocket of the [simulated device]"
        "(wire-protocol.md#the-simulated-device) switches on a fault that has a\nname; the "
        f"others occur on the host.\n\n{rows}\n"
    )


PAGES: dict[str, Callable[[], str]] = {
    "columns.md": columns_page,
    "commands.md": commands_page,
    "faults.md": faults_page,
    "journal-events.md": event_list,
    "people-parameters.md": parameters_page,
    "python-package.md": python_page,
    "statistics.md": statistics_page,
}


def main() -> None:
    """Write the pages."""
    FOLDER.mkdir(exist_ok=True)
    for name, page in PAGES.items():
        Path(FOLDER / name).write_text(f"{page().rstrip()}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
