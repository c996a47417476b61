"""The command that locks a study's plan and analysis: register."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from runner.cli.options import JsonOption, StudyArgument
from runner.cli.output import print_json, say

app = typer.Typer()


@app.command()
def register(
    study: StudyArgument,
    primary: Annotated[
        str | None,
        typer.Option(metavar="NAME", help='The hypothesis tested first. ["conditions differ"]'),
    ] = None,
    hypothesis: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help='A further one, such as "voltage above structure".'),
    ] = None,
    power: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Result of `touchbeam power`. [default: STUDY/power/power.json, if it is there]",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Lock the plan and the analysis before the first session.

    Writes registration.toml and registration.txt, a text to paste into a registry. Its digest then
    seeds every order, so that the data prove that the plan came first.
    """
    from analysis.loading.exclusions import rules_in_words
    from analysis.report.registration.analysis_settings import analysis_settings
    from device.friction.contrasts import LAW, RUNG
    from protocol.registration.registration import FILE, OMNIBUS
    from protocol.registration.registry_text import registry_text
    from runner.clock import WallClock
    from runner.journal.location import checked_place, mounts_of_this_machine
    from runner.study.calibration import fitted_calibration
    from runner.study.check import validated_study
    from runner.study.folder import StudyFolder
    from runner.study.registered import REGISTRY_FILE, Choice, new_registration
    from runner.study.registered import register as write

    folder = StudyFolder(path=study)
    text = folder.text()
    checked = validated_study(text, str(folder.study_file))
    checked_place(folder.path, mounts_of_this_machine())
    choice = Choice(
        primary=primary or OMNIBUS,
        secondary=hypothesis or [],
        law=LAW,
        rung=RUNG,
        analysis=analysis_settings(checked.rating.minimum),
        exclusions=rules_in_words(checked.exclusions),
        power=power or (kept if (kept := study / "power" / "power.json").exists() else None),
    )
    made = new_registration(checked, text, choice, fitted_calibration(study))
    made, replaced = write(folder, checked, made, WallClock())
    told = registry_text(checked, made)
    if as_json:
        print_json(
            {
                "digest": made.digest,
                "file": str(study / FILE),
                "primary": made.primary,
                "secondary": list(made.secondary),
                "participants": made.participants,
                "replaced": replaced,
                "text": told,
            }
        )
        return
    for line in told.splitlines():
        say(line)
    say("")
    say(f"Registered: {made.digest}")
    if replaced:
        say(f"This replaces {replaced}")
    say(f"Written: {study / FILE}; the text above: {study / REGISTRY_FILE}")
    say(f"Paste it into a registry now, then: touchbeam check {shlex.quote(str(study))}")
