"""Commands that take data in and give them away: import, export."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from typer import Argument, Option, Typer

from protocol.errors import BadInput, typed_as
from touchbeam.cli import options
from touchbeam.cli.output import counted, followed, say
from touchbeam.cli.results import warn_of_broken

app = Typer()


@app.command("import")
def import_scores(
    scores: Annotated[
        Path,
        Argument(metavar="TABLE", help="A CSV file: subject, then conditions."),
    ],
    study: Annotated[Path, Argument(metavar="STUDY", help="A new or an empty folder.")],
    keep_means: Annotated[
        bool,
        Option(
            "--keep-means", help="Take a column or row that is the mean of all others as scores."
        ),
    ] = False,
) -> None:
    """Create a study from published scores.

    The table has a column `subject` and one column per condition. Each subject is a pseudonym of
    letters, digits, - and _ with a digit in it; a blank cell is a missing score.
    """
    from analysis.loading.published import MOST_BYTES, published_table, unpredicted_note
    from runner.study.files import bytes_of, text_of
    from runner.study.table_import import import_table

    if scores.is_dir():
        raise BadInput(f"{scores}: must be a table of scores, a CSV file, got a folder")
    content = bytes_of(scores, most=MOST_BYTES)
    table = published_table(text_of(content, scores), str(scores), keep_means=keep_means)
    rows = followed("subjects", table.by_subject().items(), len(table.subjects))
    import_table(options.study_folder(study), rows, scores.name, content)
    if note := unpredicted_note(table.conditions):
        say(note)
    imported = counted(len(table.subjects), "subject")
    say(f"{imported} imported; next: touchbeam report {typed_as(study)}")


@app.command(cls=options.Choosing)
def export(
    study: options.StudyArgument,
    folder: Annotated[
        Path, Argument(parser=options.named_folder, metavar="DIR", help="A new or an empty folder.")
    ],
    as_format: options.FormatOption,
    rehearsals: options.RehearsalsOption = False,
    participant: Annotated[
        str | None, Option(help="Export the data of this participant alone.")
    ] = None,
) -> None:
    """Export the data, one row per trial.

    Withdrawn participants are omitted; excluded trials are included and flagged.
    """
    from importlib.metadata import version

    from analysis.export.dataset import dataset
    from analysis.export.formats import EXPORTS, RECORDINGS
    from device.friction.calibration import NOMINAL
    from runner.journal.verification import readable_chains, require_no_withdrawal
    from runner.study.calibration import fitted_calibration
    from runner.study.files import write_new_folder

    source = options.study_folder(study)
    with options.study_journal(source) as journal:
        file = source.study()
        _require_known(participant, journal.sessions())
        withdrawals, broken = journal.withdrawals(), list[str]()
        chains = readable_chains(journal, broken, participant, rehearsals=rehearsals)
        data = dataset(
            followed("sessions", chains, len(journal.sessions())),
            file,
            version("touchbeam"),
            rehearsals=rehearsals,
            # Tables alone have predictions.
            rig=fitted_calibration(source.path, file) if as_format == "csv" else NOMINAL,
            broken_chains=broken,
        )
        texts = EXPORTS[as_format](data)
    warn_of_broken(broken, study)
    # One by one, because texts and bytes of all would need twice the memory.
    files = {name: texts.pop(name).encode() for name in tuple(texts)} | RECORDINGS[as_format](data)
    # Who withdrew while it was made is in what was read before.
    write_new_folder(files, folder, partial(require_no_withdrawal, source.journal, withdrawals))
    say(f"Written: {folder}, {data.summary()}")


def _require_known(participant: str | None, sessions: Sequence[str]) -> None:
    known = sorted({name.rpartition("/")[0] for name in sessions} - {""})
    if participant is not None and participant not in known:
        near = [name for name in known if name.casefold() == participant.casefold()]
        hint = f"did you mean {near[0]}?" if near else "touchbeam status lists the participants"
        raise BadInput(f"{participant} has no session in this study; {hint}")
