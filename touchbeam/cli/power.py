"""The command `power`: power and precision of a study by simulation."""

import os
from collections.abc import Mapping
from itertools import chain
from math import isfinite
from typing import TYPE_CHECKING, Annotated

from typer import Option, Typer

from protocol.errors import BadInput
from touchbeam.cli.options import JsonOption, PeopleOption, StudyArgument, people_in_file
from touchbeam.cli.output import complain, followed, print_json, print_table, say

if TYPE_CHECKING:
    from analysis.estimates import FloatArray, Json
    from analysis.power.diagnosands import Findings, Measured
    from analysis.power.job import Job, Kind, Task
    from analysis.power.track_diagnosands import TrackFindings
    from protocol.study.study import Study
    from runner.study.kept_files import PowerFolder

app = Typer()
_MOST_DIGITS = 9
"""Of a number of participants, repeats or levels, of which each has a limit far below."""


def _numbers(given: str | None, option: str) -> list[int]:
    texts = [] if given is None else given.split(",")
    # Before `int`, which refuses numbers of more than 4300 digits in words of its own.
    if any(len(text.strip()) > _MOST_DIGITS for text in texts):
        rule = f"must be numbers of at most {_MOST_DIGITS} digits"
        raise BadInput(f"{option} {rule}, got a longer one")
    if not all(text.strip().isdecimal() and int(text) > 0 for text in texts):
        rule = "must be whole numbers above 0 by commas, such as 9,12,20"
        raise BadInput(f"{option} {rule}, got {given!r}")
    return sorted({int(text) for text in texts})


@app.command()
def power(
    study: StudyArgument,
    studies: Annotated[
        int, Option(min=2, max=1_000_000, help="Simulated studies of each design.")
    ] = 500,
    null_studies: Annotated[
        int | None,
        Option(
            min=2,
            max=1_000_000,
            help="Further ones of each, without any effect. [default: twice as many]",
        ),
    ] = None,
    participants: Annotated[
        str | None, Option(metavar="N,…", help="[default: the study's, or 9]")
    ] = None,
    repeats: Annotated[str | None, Option(metavar="N,…", help="[default: the study's]")] = (None),
    levels: Annotated[
        str | None, Option(metavar="N,…", help="Of every amplitude. [default: the study's]")
    ] = None,
    tests_only: Annotated[
        bool, Option("--tests-only", help="Leave out the sensitivity models: much faster.")
    ] = False,
    workers: Annotated[
        int | None, Option(min=1, max=1024, help="Processes. [default: one per core]")
    ] = None,
    scheduler: Annotated[
        str | None,
        Option(metavar="URL", help="Compute on this Dask cluster, such as tcp://HOST:8786."),
    ] = None,
    people: PeopleOption = None,
    seed: Annotated[int, Option(min=0)] = 1,
    as_json: JsonOption = False,
) -> None:
    """Simulate a study many times: its power and its precision.

    Results are kept in STUDY/power, so that an interrupted run goes on and a longer one goes
    further. 'Plan participants: power' (touchbeam docs) explains every number.
    """
    from importlib.metadata import version
    from time import perf_counter

    from analysis.power.diagnosands import findings
    from analysis.power.job import Design, Job, asked, designed, designs, tasks
    from analysis.power.track_diagnosands import held_of_tracks, track_findings
    from protocol.study_file.loading import text_digest
    from runner.study import calibration, files
    from runner.study.folder import StudyFolder
    from runner.study.kept_files import PowerFolder, own_key
    from runner.study.registered import checked_registration

    begun_s = perf_counter()
    folder = StudyFolder(path=study)
    file = folder.study()
    if people is not None:
        people_in_file(people)  # a mistake in it is told before anything is computed
    scored = len(file.conditions) > 1
    sizes = {"--participants": participants, "--repeats": repeats, "--levels": levels}
    wanted = designs(file, *(_numbers(given, option) for option, given in sizes.items()))
    for design in wanted:
        # Each design is tried before the first is simulated, because that takes minutes.
        designed(file, design)
    if not scored and not file.track:
        raise BadInput(f"{study}: a power analysis needs at least 2 conditions, got 1")
    registered = checked_registration(folder)
    # Workers read the text that the job holds.
    job = Job(
        study=folder.text(),
        version=version("touchbeam"),
        seed=seed,
        rig=calibration.fitted_calibration(folder.path),
        people="" if people is None else files.short_text(people),
    )
    kind: Kind = "tested" if tests_only else "fitted"
    to_do = {
        design: (tasks(design, kind, studies), tasks(design, "null", null_studies or 2 * studies))
        for design in (wanted if scored else ())
    }
    # Repeats are of conditions, and tracks have none.
    alike = (Design(participants=it.participants, repeats=file.design.repeats) for it in wanted)
    of_tracks = {each: tasks(each, "tracks", studies) for each in (alike if file.track else ())}
    place = PowerFolder(study=folder.path, digest=job.digest, key=own_key())
    every = [task for own in chain(*to_do.values(), of_tracks.values()) for task in own]
    rows, used = _computed(job, every, place, workers, scheduler, alone=as_json)
    hypotheses = registered.hypotheses if registered else ()
    # Beside conditions, hypotheses on tracks are told in one place with the others.
    of_tracks_alone = () if scored else hypotheses
    thresholds, held = [], {}
    for design, part in of_tracks.items():
        of = _joined(part, rows)
        thresholds.append(track_findings(file, design.participants, of, of_tracks_alone))
        held[design.participants] = held_of_tracks(file, of, hypotheses)
    found = []
    for design, both in to_do.items():
        own, null = (_joined(part, rows) for part in both)
        held_here = held.get(design.participants)
        found.append(findings(design, asked(job), own, null, hypotheses, held_here))
    record = _kept(found, thresholds, (file, text_digest(job.study), seed), place)
    if as_json:
        elapsed_s = round(perf_counter() - begun_s, 3)
        return print_json({**record, "elapsed_s": elapsed_s, "workers": used})
    if found:
        _print(found, record)
    _print_tracks(thresholds)
    more = "; beside it power.svg and calibration.svg" * bool(found)
    return say(f"Written: {place.path / 'power.json'}{more}")


def _computed(
    job: "Job",
    every: "list[Task]",
    place: "PowerFolder",
    workers: int | None,
    scheduler: str | None,
    *,
    alone: bool,
) -> "tuple[dict[Task, FloatArray], int]":
    """Return the rows of all tasks, and how many processes or threads computed them."""
    from analysis.power.engine import cluster_size, completed, kept

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
    results = completed(job, every, place, used, scheduler)
    return dict(followed("studies", results, len(every), alone=alone)), used


def _joined(own: "list[Task]", rows: "Mapping[Task, FloatArray]") -> "FloatArray":
    """Return the rows of tasks as one array."""
    import numpy as np

    return np.concatenate([rows[task] for task in own])


def _kept(
    found: "list[Findings]",
    thresholds: "list[TrackFindings]",
    of: "tuple[Study, str, int]",
    place: "PowerFolder",
) -> "Json":
    """Write what is found, and return it with the power for registered hypotheses."""
    from dataclasses import replace

    from analysis.cells import json_text
    from analysis.power.power_report import figures, power_record

    def record(found: "list[Findings]", thresholds: "list[TrackFindings]") -> "Json":
        told = power_record(found, *of) if found else {"study_sha256": of[1], "seed": of[2]}
        return told | ({"tracks": [it.record() for it in thresholds]} if thresholds else {})

    # What lies on the disk depends neither on the machine nor on a registration, which names it.
    lasting = record(
        [replace(each, registered=()) for each in found],
        [replace(each, registered=()) for each in thresholds],
    )
    drawn = figures(found) if found else {}
    place.write({"power.json": json_text(lasting).encode(), **drawn})
    return record(found, thresholds)


def _print_tracks(found: "list[TrackFindings]") -> None:
    """Print what tracks tell: errors in dB, with their Monte Carlo errors."""

    def told(measured: "Measured", digits: int = 2) -> str:
        return f"{measured.value:.{digits}f} ± {measured.error:.{digits}f}"

    columns = "bias, dB|RMSE, dB|coverage|trials|beyond its levels|Weber fraction shown below"
    header = ["track", *columns.split("|")]
    for of in found:
        rows = []
        for it in of.tracks:
            trials, beyond = f"{it.trials.value:.1f}", f"{100 * it.beyond.value:.1f}%"
            limit = f"{it.weber_limit:.3f}" if isfinite(it.weber_limit) else "-"
            errors = told(it.bias_db), told(it.rmse_db), told(it.coverage, 3)
            rows.append([it.name, *errors, trials, beyond, limit])
        title = f"Thresholds: {of.participants} participants, {of.studies} studies"
        print_table(title, [header, *rows, [""] * len(header)])  # no footer
        for each in of.differences:
            say(
                f"{each.above} above {each.below}, by {each.ratio_db:.1f} dB on average: "
                f"found in {100 * each.power.value:.0f}% of studies"
            )
        for own in of.registered:
            if isfinite(own.power.value):
                say(f"Registered, {own.name}: supported in {100 * own.power.value:.0f}% of studies")


def _print(found: "list[Findings]", record: "Json") -> None:
    from analysis.power.power_report import FAMILY, left_out, lines_of_estimates, lines_of_tests

    say(record["answer"])
    for warning in record["warnings"]:
        say(f"WARNING: {warning}.")
    for each in found:
        print_table(f"Tests: {each.design}", lines_of_tests(each))
        if hidden := left_out(each):
            say(f"{len(hidden)} more tests of pairs, with less power, stand in power.json.")
        print_table(f"Estimates: {each.design}", lines_of_estimates(each))
    say(FAMILY)
    say(f"Simulated: {found[0].studies} studies, {found[0].null_studies} without any effect.")
