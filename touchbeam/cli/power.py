"""The command `power`: power and precision of a study by simulation."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocol.errors import BadInput
from touchbeam.cli.options import JsonOption, PeopleOption, StudyArgument, people_in_file
from touchbeam.cli.output import complain, followed, print_json, print_table, say

if TYPE_CHECKING:
    from analysis.estimates import FloatArray, Json
    from analysis.power.diagnosands import Findings, Measured
    from analysis.power.job import Design, Job, Kind, Task
    from analysis.power.track_power import TrackFindings
    from device.people.person import Population
    from protocol.study.study import Study
    from runner.study.kept_files import PowerFolder

app = typer.Typer()
_MOST_DIGITS = 9
"""Of a number of participants, repeats or levels, of which each has a limit far below."""


def _numbers(given: str | None, option: str) -> list[int]:
    texts = [] if given is None else given.split(",")
    # Before `int`, which refuses numbers of more than 4300 digits in words of its own.
    if any(len(text.strip()) > _MOST_DIGITS for text in texts):
        raise BadInput(
            f"{option} must be numbers of at most {_MOST_DIGITS} digits, got a longer one"
        )
    if not all(text.strip().isdecimal() and int(text) > 0 for text in texts):
        raise BadInput(
            f"{option} must be whole numbers above 0 by commas, such as 9,12,20, got {given!r}"
        )
    return sorted({int(text) for text in texts})


@app.command()
def power(
    study: StudyArgument,
    studies: Annotated[
        int, typer.Option(min=2, max=1_000_000, help="Simulated studies of each design.")
    ] = 500,
    null_studies: Annotated[
        int | None,
        typer.Option(
            min=2, max=1_000_000, help="Of them without any effect. [default: twice the others]"
        ),
    ] = None,
    participants: Annotated[
        str | None, typer.Option(metavar="N,…", help="[default: the study's, or 9]")
    ] = None,
    repeats: Annotated[str | None, typer.Option(metavar="N,…", help="[default: the study's]")] = (
        None
    ),
    levels: Annotated[
        str | None, typer.Option(metavar="N,…", help="Of every amplitude. [default: the study's]")
    ] = None,
    tests_only: Annotated[
        bool, typer.Option("--tests-only", help="Leave out the sensitivity models: much faster.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes. [default: one per core]")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Compute on this Dask cluster, such as tcp://HOST:8786."),
    ] = None,
    people: PeopleOption = None,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    as_json: JsonOption = False,
) -> None:
    """Simulate a study many times: its power and its precision.

    Results are kept in STUDY/power, so that an interrupted run goes on and a longer one goes
    further. docs/power.md explains every number.
    """
    from dataclasses import replace
    from importlib.metadata import version
    from time import perf_counter

    from analysis.cells import json_text
    from analysis.power.engine import cluster_size, kept
    from analysis.power.job import Job, designed, designs, tasks
    from analysis.power.power_report import figures, power_record
    from protocol.study_file.loading import text_digest
    from runner.study.calibration import fitted_calibration
    from runner.study.files import short_text
    from runner.study.folder import StudyFolder
    from runner.study.kept_files import PowerFolder, own_key
    from runner.study.registered import checked_registration

    begun_s = perf_counter()
    folder = StudyFolder(path=study)
    file = folder.study()
    # Workers read the text that the job holds.
    population = None if people is None else people_in_file(people)
    sizes = _numbers(participants, "--participants")
    tracks = _tracks(file, folder.path, population, sizes, (studies, seed)) if file.track else []
    of_tracks = {"tracks": [each.record() for each in tracks]} if tracks else {}
    if len(file.conditions) < 2 and tracks:
        if as_json:
            return print_json({"study_sha256": text_digest(folder.text()), **of_tracks})
        return _print_tracks(tracks)
    wanted = designs(file, sizes, _numbers(repeats, "--repeats"), _numbers(levels, "--levels"))
    for design in wanted:
        # Each design is tried before the first is simulated, because that takes minutes.
        designed(file, design)
    if len(file.conditions) < 2:
        raise BadInput(f"{study}: a power analysis needs at least 2 conditions, got 1")
    registered = checked_registration(folder)
    job = Job(
        study=folder.text(),
        version=version("touchbeam"),
        seed=seed,
        rig=fitted_calibration(folder.path),
        people="" if people is None else short_text(people),
    )
    kind: Kind = "tested" if tests_only else "fitted"
    to_do = {
        design: (tasks(design, kind, studies), tasks(design, "null", null_studies or 2 * studies))
        for design in wanted
    }
    place = PowerFolder(study=folder.path, digest=job.digest, key=own_key())
    every = (task for pair in to_do.values() for own in pair for task in own)
    left = [task for task in every if kept(job, task, place) is None]
    if others := sum(place.load(task.name) is not None for task in left):
        complain(
            f"touchbeam: warning: {others} kept result{'s' * (others != 1)} in {place.chunks}: "
            "damaged, or not computed by you on this computer; computed anew"
        )
    # A container or a batch system may give fewer cores than the computer has.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    used = workers or cores or 1
    if scheduler:  # which need not be there if all is kept already
        used = cluster_size(scheduler) if left else 0
    hypotheses = registered.hypotheses if registered else ()
    found = _found(job, to_do, place, used, scheduler, hypotheses, as_json=as_json)
    # What lies on the disk depends neither on the machine nor on a registration, which names it.
    of_study = (file, text_digest(job.study), seed)
    lasting = power_record([replace(each, registered=()) for each in found], *of_study)
    place.write({"power.json": json_text(lasting).encode(), **figures(found)})
    record = power_record(found, *of_study)
    if as_json:
        elapsed_s = round(perf_counter() - begun_s, 3)
        return print_json({**record, **of_tracks, "elapsed_s": elapsed_s, "workers": used})
    _print(found, record, place.path)
    return _print_tracks(tracks)


def _tracks(
    study: "Study",
    path: Path,
    people: "Population | None",
    sizes: Sequence[int],
    of: tuple[int, int],
) -> "list[TrackFindings]":
    """Return what the tracks tell with each number of participants; `of`: studies and seed."""
    from analysis.power.track_power import track_findings
    from device.people.person import DEFAULT
    from runner.study.calibration import fitted_calibration

    studies, seed = of
    rig = fitted_calibration(path)
    return [
        track_findings(study, people or DEFAULT, rig, (studies, size), seed)
        for size in sizes or [study.design.participants or 9]
    ]


def _print_tracks(found: "list[TrackFindings]") -> None:
    """Print what tracks tell: errors in dB, with their Monte Carlo errors."""

    def told(measured: "Measured", digits: int = 2) -> str:
        return f"{measured.value:.{digits}f} ± {measured.error:.{digits}f}"

    header = ["track", "bias, dB", "RMSE, dB", "coverage", "trials", "beyond its levels"]
    for of in found:
        rows = [
            [
                each.name,
                told(each.bias_db),
                told(each.rmse_db),
                told(each.coverage, 3),
                f"{each.trials.value:.1f}",
                f"{100 * each.beyond.value:.1f}%",
            ]
            for each in of.tracks
        ]
        title = f"Thresholds: {of.participants} participants, {of.studies} studies"
        print_table(title, [header, *rows, [""] * len(header)])  # no footer
        for each in of.differences:
            say(
                f"{each.above} above {each.below}, by {each.ratio_db:.1f} dB on average: "
                f"found in {100 * each.power.value:.0f}% of studies"
            )


def _found(
    job: "Job",
    to_do: "dict[Design, tuple[list[Task], list[Task]]]",
    place: "PowerFolder",
    workers: int,
    scheduler: str | None,
    hypotheses: Sequence[str],
    *,
    as_json: bool,
) -> "list[Findings]":
    """Return the findings of each design, with a progress bar on a terminal."""
    import numpy as np

    from analysis.power.diagnosands import findings
    from analysis.power.engine import completed
    from analysis.power.job import asked

    every = [task for pair in to_do.values() for own in pair for task in own]
    results = completed(job, every, place, workers, scheduler)
    rows = dict(followed("studies", results, len(every), alone=as_json))

    def numbers(own: "list[Task]") -> "FloatArray":
        return np.concatenate([rows[it] for it in own])

    return [
        findings(design, asked(job), numbers(own), numbers(null), hypotheses)
        for design, (own, null) in to_do.items()
    ]


def _print(found: "list[Findings]", record: "Json", place: Path) -> None:
    from analysis.power.power_report import FAMILY, left_out, lines_of_estimates, lines_of_tests

    say(record["answer"])
    for warning in record["warnings"]:
        say(f"WARNING: {warning}.")
    for each in found:
        print_table(f"Tests: {each.design}", lines_of_tests(each))
        print_table(f"Estimates: {each.design}", lines_of_estimates(each))
        if hidden := left_out(each):
            say(f"{len(hidden)} more pairs, with less power, stand in power.json.")
    say(FAMILY)
    say(f"Simulated: {found[0].studies} studies, {found[0].null_studies} without any effect.")
    say(f"Written: {place / 'power.json'}; beside it power.svg and calibration.svg")
