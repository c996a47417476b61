"""The command `power`: power and precision of a study by simulation."""

import os
from itertools import chain
from typing import TYPE_CHECKING, Annotated

from typer import Option, Typer

from protocol.errors import BadInput
from touchbeam.cli.options import (
    JsonOption,
    PeopleOption,
    StudyArgument,
    people_in_file,
    study_folder,
)
from touchbeam.cli.output import complain, followed, print_json, print_table, say
from touchbeam.study import read_study

if TYPE_CHECKING:
    from analysis.estimates import Json
    from analysis.power.designs import Design
    from analysis.power.job import Job, Task
    from analysis.power.power_summary import Summary
    from device.people.person import Population
    from protocol.study.study import Study
    from runner.study.folder import StudyFolder

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
    ] = 200,
    null_studies: Annotated[
        int | None,
        Option(
            min=2,
            max=1_000_000,
            help="Null cohorts of each of three kinds. [default: twice as many]",
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
        bool, Option("--tests-only", help="Leave out the model of the answers: much faster.")
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

    A design takes about two minutes on two cores. A run that is interrupted keeps nothing. 'Plan
    participants: power' (touchbeam docs) explains every number.
    """
    from importlib.metadata import version
    from time import perf_counter

    from analysis.power.designs import designed, designs, simulated
    from analysis.power.job import Job, tasks
    from analysis.power.power_report import power_record
    from protocol.study_file.loading import text_digest
    from runner.study import calibration, files

    begun_s = perf_counter()
    folder = study_folder(study)
    text, file, answered = folder.text(), folder.study(), False
    if file.imported:
        if people is None and any(each.contrast is None for each in file.condition):
            raise BadInput(
                f"{folder.study_file}: no contrast is predicted of every condition: write contrast "
                "= 0.3 or so into each [[condition]], or say in a people file (--people) by how "
                "many points each changes a score"
            )
        answered = _answered(folder)
        file = simulated(text, answered=answered)
        what = "as answers and scores of a change" if answered else "as ratings of what is felt"
        complain(f"Imported scores: simulated {what}, without missing ones.")
    # A mistake in people is told before anything is computed.
    _require_felt(file, None if people is None else people_in_file(people))
    sizes = {"--participants": participants, "--repeats": repeats, "--levels": levels}
    wanted = designs(file, *(_numbers(given, option) for option, given in sizes.items()))
    for design in wanted:
        # Each design is tried before the first is simulated, because that takes minutes.
        designed(file, design)
    if len(file.conditions) < 2 and not file.track:
        raise BadInput(f"{study}: a power analysis needs at least 2 conditions, got 1")
    # Workers read the text that the job holds.
    job = Job(
        study=text,
        version=version("touchbeam"),
        seed=seed,
        models=not tests_only,
        rig=calibration.fitted_calibration(folder.path, file),
        people="" if people is None else files.short_text(people),
        answered=answered,
    )
    # A container or a batch system may give fewer cores than the computer has.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    used = _cluster_size(scheduler) if scheduler else workers or cores or 1
    # A null cohort has tests of conditions alone.
    null_studies = (null_studies or 2 * studies) * (len(file.conditions) > 1)
    work = {design: tasks(job, design, studies, null_studies) for design in wanted}
    summaries = _simulated(job, work, used, scheduler, alone=as_json)
    record = power_record(summaries, file, text_digest(job.study), seed)
    if as_json:
        elapsed_s = round(perf_counter() - begun_s, 3)
        return print_json({**record, "elapsed_s": elapsed_s, "workers": used})
    return _print(summaries, record)


def _answered(folder: "StudyFolder") -> bool:
    """Return whether imported scores came with answers, as far as there is a journal of them."""
    if not folder.journal.exists():
        return False
    recorded = read_study(folder, rehearsals=False).recorded
    return bool(recorded.trials["question"].notna().any())


def _require_felt(study: "Study", population: "Population | None") -> None:
    """Refuse a study of whose friction nothing is known, unless people are told what it is."""
    from device.people.answering import is_stated
    from device.people.people_file import EFFECT_EXAMPLE, require_effects

    if study.surface.kind != "given":
        return
    if study.track:
        raise BadInput(
            "virtual people cannot feel the levels of tracks on a surface of kind given; leave the "
            "tracks out, or measure friction and take kind measured"
        )
    if population is not None and population.effect is not None:
        require_effects(population, study)
    elif not is_stated(study):
        raise BadInput(
            "the friction of this surface is not known: state it at every touch, or say in a "
            "people file (--people) by how many points each condition changes a score, "
            f"{EFFECT_EXAMPLE}"
        )


def _cluster_size(scheduler: str) -> int:
    from analysis.power.engine import connected

    with connected(scheduler) as client:
        return int(sum(client.nthreads().values()))


def _simulated(
    job: "Job",
    tasks: "dict[Design, list[Task]]",
    workers: int,
    scheduler: str | None,
    *,
    alone: bool,
) -> "list[Summary]":
    """Return the summary of each design, all of which are simulated at once."""
    from analysis.power.engine import completed
    from analysis.power.job import asked
    from analysis.power.null_cohorts import kinds_of
    from analysis.power.power_summary import summary
    from analysis.power.study_records import Records

    kinds = [kind.name for kind in kinds_of(asked(job))]
    every = list(chain.from_iterable(tasks.values()))
    results = completed(job, every, workers, scheduler)
    done = dict(followed("studies", results, len(every), alone=alone))
    # In the order of the tasks, whichever was done first.
    joined = {
        (design, null): Records.joined(
            asked(job), [done[task] for task in of_design if task.null == null]
        )
        for design, of_design in tasks.items()
        for null in ("", *kinds)
    }
    return [
        summary(
            design,
            asked(job),
            joined[design, ""],
            {kind: joined[design, kind] for kind in kinds},
        )
        for design in tasks
    ]


def _print(summaries: "list[Summary]", record: "Json") -> None:
    from analysis.power.power_report import lines_of_estimates, lines_of_tests

    say(record["answer"])
    for warning in record["warnings"]:
        say(f"WARNING: {warning}.")
    for summary in summaries:
        if summary.tests:
            print_table(f"Tests: {summary.design}", lines_of_tests(summary))
        if summary.estimates:
            print_table(f"Estimates: {summary.design}", lines_of_estimates(summary))
    studies, null = summaries[0].studies, summaries[0].null_studies
    if null:
        say(record["family"])
    say(f"Simulated: {studies} studies" + f", {null} null cohorts of each kind" * bool(null) + ".")
