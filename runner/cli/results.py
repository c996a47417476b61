"""Commands for results: import, report, export, predict, ladder, claims."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocol.errors import BadInput
from protocol.journal.shared_form import FOLDER, REGISTRATION_FILE, SUFFIX
from runner.cli.options import (
    Choosing,
    FormatOption,
    JsonOption,
    LawOption,
    OverlapOption,
    StudyArgument,
    named_folder,
    study_journal,
)
from runner.cli.output import (
    complain,
    counted,
    followed,
    print_csv,
    print_json,
    print_json_text,
    print_table,
    say,
)
from runner.people.terminal import at_terminal

if TYPE_CHECKING:
    from analysis.export.dataset import Dataset
    from analysis.loading.sessions import Sessions
    from analysis.loading.study_data import StudyData
    from analysis.report.report import Report
    from runner.study.folder import StudyFolder

app = typer.Typer()


@app.command("import")
def import_scores(
    scores: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A table: subject, then conditions. Or the folder of a BIDS export.",
        ),
    ],
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="A new or an empty folder.")],
    keep_means: Annotated[
        bool,
        typer.Option(
            "--keep-means", help="Take a column or row that is the mean of all others as scores."
        ),
    ] = False,
) -> None:
    """Create a study from published scores, or from the BIDS export of another one.

    A table is a CSV file with a column `subject` and one column per condition. Each subject is a
    pseudonym of letters, digits, - and _ with a digit in it; a blank cell is a missing score.
    """
    if scores.is_dir():
        _import_data_set(scores, study)
        return
    from analysis.loading.published import published_table, unpredicted_note
    from runner.study.files import bytes_of, text_of
    from runner.study.folder import StudyFolder
    from runner.study.published import import_table

    content = bytes_of(scores)
    table = published_table(text_of(content, scores), str(scores), keep_means=keep_means)
    rows = followed("subjects", table.by_subject().items(), len(table.subjects))
    import_table(StudyFolder(path=study), rows, scores.name, content)
    note = unpredicted_note(table.conditions)
    if note:
        say(note)
    imported = counted(len(table.subjects), "subject")
    say(f"{imported} imported; next: touchbeam report {shlex.quote(str(study))}")


def _import_data_set(source: Path, study: Path) -> None:
    from analysis.loading.sessions import load_sessions
    from runner.study.data_set import import_data_set, read_data_set
    from runner.study.folder import StudyFolder

    data = read_data_set(source)
    try:  # the events are in order, but a value in them may have been changed
        load_sessions(session.events for session in data.sessions.values())
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise BadInput(f"{source}: a session cannot be read ({error})") from error
    import_data_set(StudyFolder(path=study), data)
    imported = counted(len(data.sessions), "session")
    say(f"{imported} imported; next: touchbeam report {shlex.quote(str(study))}")


@app.command()
def report(
    study: StudyArgument,
    out: Annotated[
        Path | None,
        typer.Option(parser=named_folder, metavar="DIR", help="[default: STUDY/report]"),
    ] = None,
    rehearsals: Annotated[
        bool, typer.Option("--rehearsals", help="Include rehearsals, marked as such.")
    ] = False,
    sections: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Sections of the page, by commas; else those of report.toml, or all.",
        ),
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Report Table 4, statistics and figures.

    Writes an HTML page, figures, CSV, LaTeX and JSON files.
    """
    from runner.study.folder import StudyFolder

    folder = StudyFolder(path=study)
    named = None if sections is None else tuple(map(str.strip, sections.split(",")))
    chosen = folder.report_sections() if named is None else named
    where = out or folder.report
    write_report(folder, where, rehearsals=rehearsals, as_json=as_json, shown=chosen)
    if show:
        import webbrowser

        webbrowser.open((where / "report.html").resolve().as_uri())


@app.command(cls=Choosing)
def export(
    study: StudyArgument,
    folder: Annotated[
        Path, typer.Argument(parser=named_folder, metavar="DIR", help="A new or an empty folder.")
    ],
    as_format: FormatOption,
    rehearsals: Annotated[
        bool, typer.Option("--rehearsals", help="Include rehearsals, marked as such.")
    ] = False,
    participant: Annotated[
        str | None, typer.Option(help="Export the data of this participant alone.")
    ] = None,
) -> None:
    """Export the data, one row per trial.

    Withdrawn participants are omitted; excluded trials are included and flagged.
    """
    from importlib.metadata import version

    from analysis.export.dataset import dataset
    from analysis.export.formats import EXPORTS, RECORDINGS, WITH_CONTRASTS, WITH_SOURCE
    from analysis.export.source_data import source_files
    from device.friction.calibration import NOMINAL
    from runner.journal.verification import readable_chains
    from runner.study.calibration import fitted_calibration
    from runner.study.files import write_new_folder
    from runner.study.folder import StudyFolder

    source = StudyFolder(path=study)
    broken: list[str] = []
    with study_journal(source) as journal:
        _require_known(participant, journal.sessions())
        mine = readable_chains(journal, broken, participant)
        chains = followed("sessions", mine, len(journal.sessions()))
        data = dataset(
            chains,
            source.study(),
            version("touchbeam"),
            rehearsals=rehearsals,
            rig=fitted_calibration(source.path) if as_format in WITH_CONTRASTS else NOMINAL,
            broken_chains=broken,
        )
        texts = EXPORTS[as_format](data)
        if as_format in WITH_SOURCE:
            again = readable_chains(journal, [], participant)
            texts |= source_files(data, again, source.text())
    _warn_of_broken(broken, study)
    files = {name: text.encode() for name, text in texts.items()} | RECORDINGS[as_format](data)
    if as_format == "rocrate":
        files |= _report_in_crate(source, files, broken, rehearsals=rehearsals)
        files |= _crate_metadata(data, files)
    write_new_folder(files, folder)
    say(f"Written: {folder}, {data.summary()}")


def _report_in_crate(
    source: "StudyFolder", files: Mapping[str, bytes], broken: Sequence[str], *, rehearsals: bool
) -> dict[str, bytes]:
    """Return the report on the events among `files`: on what others get, and on nothing else."""
    from analysis.export.rocrate import REPORT
    from analysis.loading.sessions import load_sessions
    from analysis.loading.study_data import NothingToReport, study_data
    from analysis.report.report import report_files
    from protocol.registration.registration import shared_registration
    from runner.study.data_set import shared_sessions

    texts = {name: content.decode() for name, content in files.items() if name.endswith(SUFFIX)}
    chains = [session.events for session in shared_sessions(texts)]
    if registered := files.get(f"{FOLDER}/{REGISTRATION_FILE}"):
        chains.insert(0, (shared_registration(registered.decode()),))
    recorded = load_sessions(chains)
    rules = source.study().exclusions
    try:
        found = study_data(recorded, rehearsals=rehearsals, rules=rules)
    except NothingToReport as error:
        complain(f"touchbeam: warning: there is no report in it: {error}")
        return {}
    shown = source.report_sections()
    result = _report_on(
        source, found, broken, rehearsals=rehearsals, shown=shown, recorded=recorded
    )
    return {f"{REPORT}/{name}": content for name, content in report_files(result).items()}


def _crate_metadata(data: "Dataset", files: Mapping[str, bytes]) -> dict[str, bytes]:
    from analysis.export.rocrate import METADATA, crate_metadata

    return {METADATA: crate_metadata(data, files, datetime.now(UTC).date()).encode()}


def _require_known(participant: str | None, sessions: Sequence[str]) -> None:
    """Refuse a participant who has no session."""
    known = sorted({name.rpartition("/")[0] for name in sessions} - {""})
    if participant is not None and participant not in known:
        near = [name for name in known if name.casefold() == participant.casefold()]
        hint = f"did you mean {near[0]}?" if near else "touchbeam status lists the participants"
        raise BadInput(f"{participant} has no session in this study; {hint}")


@app.command(cls=Choosing)
def predict(
    scenes: Annotated[Path, typer.Argument(metavar="SCENES.csv", help="One row per scene.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="OUT.csv", help="Output file; - for standard output."),
    ],
    law: LawOption = "consistent",
    rung: Annotated[str, typer.Option(help="auto or a rung of `touchbeam ladder`.")] = "auto",
    tolerance: Annotated[float, typer.Option(help="Largest error in μ' allowed for auto.")] = 0.01,
    eq15_overlap: OverlapOption = "first",
    study: Annotated[Path | None, typer.Option(help="Study whose values fill blank cells.")] = None,
) -> None:
    """Predict the friction of many scenes.

    Every column is optional; docs/model.md lists them. If any cell is invalid, nothing is
    written.
    """
    from analysis.model.predict import PredictOptions, study_defaults
    from analysis.model.predict import predict as predicted
    from device.friction.calibration import NOMINAL
    from runner.study.calibration import fitted_calibration
    from runner.study.files import bytes_of, is_stream, text_of, write_whole
    from runner.study.folder import StudyFolder

    rig = fitted_calibration(study) if study else NOMINAL
    options = PredictOptions(
        law=law, rung=rung, tolerance=tolerance, eq15_overlap=eq15_overlap, rig=rig
    )
    defaults = study_defaults(StudyFolder(path=study).study(), rig) if study else None
    text = predicted(str(scenes), text_of(bytes_of(scenes), scenes), options, defaults)
    to_stdout = str(out) == "-"
    if to_stdout:
        print_csv(text)
    else:
        write_whole(out, text.encode())
    # Keep the message out of a stream that a program reads as a table.
    streamed = to_stdout or is_stream(out)
    if not streamed or at_terminal(sys.stderr):
        own = f" on the rig with {rig}" if rig.origin else ""
        told = f"{counted(text.count(chr(10)) - 1, 'scene')} predicted{own}: {out}"
        (complain if streamed else say)(told)


@app.command()
def ladder(
    as_json: JsonOption = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Plot error against time: svg, png or pdf.")
    ] = None,
) -> None:
    """Measure speed and accuracy of the friction model.

    Runs every rung of the model in the paper's scene on this computer.
    """
    from analysis.model.ladder import ladder_json, ladder_lines, ladder_panel, measured_ladder

    kind = plot.suffix.removeprefix(".").lower() if plot else "svg"
    if kind not in ("svg", "png", "pdf"):
        raise BadInput(f"--plot must end in .svg, .png or .pdf, got {plot}")
    rows = measured_ladder()
    if plot:
        from analysis.report.drawing import panels_figure
        from runner.study.files import write_whole

        write_whole(plot, panels_figure([ladder_panel(rows)], kind))
        (complain if as_json else say)(f"Written: {plot}")
    if as_json:
        print_json(ladder_json(rows))
        return
    print_table("The ladder", ladder_lines(rows))


@app.command()
def claims(as_json: JsonOption = False) -> None:
    """Check the paper's claims.

    Recomputes each claim under every friction law, or once if no law plays a role.
    """
    from analysis.claims.audit import audit, claims_json, claims_lines, summary_line

    results = audit()
    if as_json:
        print_json(claims_json(results))
        return
    print_table("Claims", claims_lines(results), of_sentences=True)
    say(summary_line(results))


def write_report(
    folder: "StudyFolder",
    out: Path,
    *,
    rehearsals: bool,
    as_json: bool,
    shown: tuple[str, ...] | None = None,
) -> None:
    """Write the report on the study in `folder` to the folder `out` and print Table 4.

    Its page shows the sections `shown`, None for all.
    """
    from analysis.loading.missing_scores import marks
    from analysis.loading.sessions import load_sessions
    from analysis.loading.study_data import study_data
    from analysis.report.page import require_sections
    from analysis.report.registration.registered import registered_lines
    from analysis.report.report import asks_for_multiverse, report_files
    from analysis.report.sections.left_out import left_out_lines
    from analysis.report.table4_text import table4_lines
    from analysis.report.wording import omnibus_line
    from runner.journal.verification import readable_chains
    from runner.study.files import write_files

    require_sections(shown or ())
    broken: list[str] = []
    with study_journal(folder) as journal:
        study = folder.study()
        readable, sessions = readable_chains(journal, broken), len(journal.sessions())
        chains = followed("sessions", readable, sessions, alone=as_json)
        recorded = load_sessions(chains)
    found = study_data(recorded, rehearsals=rehearsals, rules=study.exclusions)
    kept = recorded if asks_for_multiverse(shown) else None
    del recorded  # it may be large
    _warn_of_broken(broken, folder.path)
    result = _report_on(folder, found, broken, rehearsals=rehearsals, shown=shown, recorded=kept)
    if out.exists() and not out.is_dir():
        raise BadInput(f"{out}: must be a folder for the report, got a file")
    files = report_files(result)
    write_files(files, out, replaced=result.figure_files)
    if as_json:
        print_json_text(files["report.json"].decode())
        return
    table4 = result.table.main.table4
    figures = len(result.figure_files & files.keys())
    others = files.keys() - result.figure_files - {"report.html"}
    beside = [*sorted(others), f"{figures} figure files"]
    print_table("Table 4", table4_lines(table4, "–", marks(result.loaded.empty)))
    for line in (
        *result.table_notes,
        omnibus_line(result.table.main),
        *registered_lines(result),
        *left_out_lines(found),
        f"Written: {out / 'report.html'} (open it in a browser); beside it {', '.join(beside)}",
    ):
        say(line)


def _report_on(
    folder: "StudyFolder",
    found: "StudyData",
    broken: Sequence[str],
    *,
    rehearsals: bool,
    shown: tuple[str, ...] | None,
    recorded: "Sessions | None",
) -> "Report":
    """Return the report on `found`, data of the study in `folder`; `recorded` are all sessions."""
    from analysis.report.findings import origin_of, title_of
    from analysis.report.report import report
    from runner.study.calibration import fitted_calibration
    from runner.study.registered import registration_problem

    with study_journal(folder) as journal:
        unlocked = registration_problem(journal, folder.path)
    name, rig, study = folder.path.resolve().name, fitted_calibration(folder.path), folder.study()
    origin = origin_of(
        name, folder.text(), rehearsals=rehearsals, broken=broken, rig=rig, unlocked=unlocked
    )
    return report(title_of(study), found, study, origin, shown, recorded)


def _warn_of_broken(sessions: "Sequence[str]", study: Path) -> None:
    if not sessions:
        return
    named = ", ".join(sessions[:10]) + (f" and {len(sessions) - 10} more" if sessions[10:] else "")
    complain(
        f"touchbeam: warning: the journal was modified outside touchbeam, in {named}; "
        f"see touchbeam verify {study}"
    )
