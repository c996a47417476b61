"""Commands that take data in and give them away: import, export."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option, Typer

from protocol.errors import BadInput, typed_as
from touchbeam.cli import options
from touchbeam.cli.output import counted, followed, say
from touchbeam.cli.results import warn_of_broken

app = Typer()


@app.command("import", cls=options.Choosing)
def import_scores(
    table: Annotated[
        Path, Argument(metavar="TABLE", help="A CSV or text file, or a workbook (.xlsx).")
    ],
    study: Annotated[Path, Argument(metavar="STUDY", help="A new or an empty folder.")],
    scale: Annotated[
        tuple[int, int] | None,
        Option(metavar="LOW HIGH", help="The ends of the scale. [default: not known]"),
    ] = None,
    columns: Annotated[
        str | None,
        options.columns_option(
            "What columns are: subject=, condition=, factor=, score=, answer=, repeat=, session=, "
            "group=, contrast=, ignore=. [default: by their names]"
        ),
    ] = None,
    answers: Annotated[
        str | None,
        Option(
            metavar="WORD=MEANING,…",
            help="What words of answers mean: expected, contrary or same.",
            callback=options.text,
        ),
    ] = None,
    missing: options.MissingOption = None,
    keep_means: Annotated[
        bool,
        Option("--keep-means", help="Take columns and rows that are means of others as scores."),
    ] = False,
    sheet: options.SheetOption = None,
    encoding: options.EncodingOption = None,
    decimal: options.DecimalOption = None,
) -> None:
    """Create a study from a table of scores.

    The table is wide, with a column per condition, or long, with a row per score; commas,
    semicolons or tabs separate its cells. What is understood is printed before anything is
    written. Names of persons are not stored.
    """
    from hashlib import sha256

    from analysis.tables import imported_study
    from analysis.tables.answer_words import told_meanings, with_answers
    from analysis.tables.ratings import ANSWERS, ANSWERS_EXAMPLE
    from analysis.tables.reading import cells_in
    from analysis.tables.roles import roles_in
    from analysis.tables.score_table import MOST_BYTES, MOST_ROWS, scores_in
    from analysis.tables.shape import shape_of
    from runner.study.files import bytes_of
    from runner.study.folder import import_scores as written
    from runner.study.folder import require_free

    if table.is_dir():
        raise BadInput(f"{table}: must be a table of scores, a CSV file or .xlsx, got a folder")
    content = bytes_of(table, most=MOST_BYTES)
    dialect: dict[str, Any] = {"encoding": encoding, "decimal": decimal, "sheet": sheet}
    cells = cells_in(content, str(table), most=MOST_ROWS, **dialect).without(missing)
    words = told_meanings(answers, ANSWERS, ANSWERS_EXAMPLE)
    roles = with_answers(cells, roles_in(cells, columns), words)
    shape = shape_of(cells, roles, keep_means=keep_means)
    if shape.is_wide and words:
        raise BadInput(f"{table}: --answers needs a row per score; here columns are conditions")
    imported = scores_in(cells, shape, scale=scale, answers=answers, keep_means=keep_means)
    folder = options.study_folder(study)
    require_free(folder)
    for line in imported.lines:
        say(line)
    digest = sha256(content).hexdigest()
    text, imported = imported_study.described(imported, table.name, digest)
    sessions = list(imported_study.events_of(imported, table.name, digest))
    followed_sessions = followed("sessions", sessions, len(sessions))
    written(folder, text, table.stem, followed_sessions)
    people = counted(len({each.participant for each in sessions}), "subject")
    say(f"{people} imported; next: touchbeam report {typed_as(study)}")


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
        _, file = source.recorded(journal)
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
