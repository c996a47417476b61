"""Commands for results: report, predict, ladder, claims."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocol.errors import BadInput
from runner.people.terminal import at_terminal
from touchbeam.cli.options import (
    Choosing,
    JsonOption,
    LawOption,
    OverlapOption,
    RehearsalsOption,
    StudyArgument,
    named_folder,
    study_folder,
    study_journal,
)
from touchbeam.cli.output import (
    complain,
    counted,
    followed,
    print_csv,
    print_json,
    print_json_text,
    print_table,
    say,
)
from touchbeam.study import made_report

if TYPE_CHECKING:
    from runner.study.folder import StudyFolder

app = typer.Typer()


@app.command()
def report(
    study: StudyArgument,
    out: Annotated[
        Path | None,
        typer.Option(parser=named_folder, metavar="DIR", help="[default: STUDY/report]"),
    ] = None,
    rehearsals: RehearsalsOption = False,
    sections: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Sections of the page, by commas; else those of report.toml, or all.",
        ),
    ] = None,
    figures: Annotated[
        bool, typer.Option("--figures", help="Also write each figure as files: SVG, PDF, PNG.")
    ] = False,
    show: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Report Table 4, statistics and figures.

    Writes an HTML page with all figures, CSV, LaTeX and JSON files.
    """
    folder = study_folder(study)
    named = None if sections is None else tuple(map(str.strip, sections.split(",")))
    write_report(folder, out, rehearsals=rehearsals, as_json=as_json, named=named, figures=figures)
    if show:
        import webbrowser

        webbrowser.open(((out or folder.report) / "report.html").resolve().as_uri())


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
    from device.friction.scenes import NOMINAL
    from runner.study.calibration import fitted_calibration
    from runner.study.files import bytes_of, is_stream, text_of, write_whole

    rig = fitted_calibration(study) if study else NOMINAL
    options = PredictOptions(
        law=law, rung=rung, tolerance=tolerance, eq15_overlap=eq15_overlap, rig=rig
    )
    defaults = study_defaults(study_folder(study).study(), rig) if study else None
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

    # Refused before the rungs are timed, which takes a while.
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


@dataclass(frozen=True, kw_only=True)
class Written:
    """The files of a report, by relative path, and what the command says of it.

    `figure_files` are the paths of all figures that a report may have.
    """

    files: Mapping[str, bytes]
    figure_files: tuple[str, ...]
    table4: tuple[tuple[str, ...], ...]
    lines: tuple[str, ...]
    broken: tuple[str, ...]


class _NotToKeep(Exception):
    """The journal grew while it was read, or the report is too large to be kept."""

    def __init__(self, made: Written) -> None:
        super().__init__()
        self.made = made


def write_report(
    folder: "StudyFolder",
    out: Path | None,
    *,
    rehearsals: bool,
    as_json: bool,
    named: tuple[str, ...] | None = None,
    figures: bool = False,
) -> None:
    """Write the report on the study in `folder` to the folder `out` and print Table 4.

    Without `out` it goes to `report` in the study's folder. Its `figures` become files if asked.
    Its page shows the sections `named`; without them those of `report.toml`, or all.
    """
    from runner.study.files import write_files

    if named is not None:
        from analysis.report.page import require_sections

        require_sections(named)
    made = _kept_report(folder, rehearsals=rehearsals, named=named, figures=figures, alone=as_json)
    warn_of_broken(made.broken, folder.path)
    place = out or folder.report
    if place.exists() and not place.is_dir():
        raise BadInput(f"{place}: must be a folder for the report, got a file")
    # A folder that the user named may contain a link; one in a study may be a stranger's.
    own = None if out else folder.path
    write_files(made.files, place, replaced=made.figure_files, study=own)
    if as_json:
        print_json_text(made.files["report.json"].decode())
        return
    drawn = len(set(made.figure_files) & made.files.keys())
    others = made.files.keys() - {*made.figure_files, "report.html"}
    beside = [
        *sorted(others),
        f"{drawn} figure files" if figures else "with --figures figure files",
    ]
    print_table("Table 4", made.table4)
    for line in made.lines:
        say(line)
    say(f"Written: {place / 'report.html'} (open it in a browser); beside it {', '.join(beside)}")


def _kept_report(
    folder: "StudyFolder",
    *,
    rehearsals: bool,
    named: tuple[str, ...] | None,
    figures: bool,
    alone: bool,
) -> Written:
    """Return the report; of a journal whose bytes are as they were, the one that was made then."""
    from analysis.kept import Kept
    from runner.study.calibration import fitted_calibration
    from runner.study.kept_files import code_version, journal_digest, kept_files
    from runner.study.registered import registration_problem

    with study_journal(folder) as journal:
        unlocked = registration_problem(journal, folder.path)
        keep = Kept(kept_files(journal), code_version())
    text, shown = folder.text(), folder.report_sections() if named is None else named
    before = journal_digest(folder.journal)

    def make() -> Written:
        made = _made(folder, rehearsals=rehearsals, named=named, figures=figures, alone=alone)
        too_large = sum(map(len, made.files.values())) > _MOST_KEPT
        # A session went on meanwhile: the report is of another state of the journal.
        if too_large or journal_digest(folder.journal) != before:
            raise _NotToKeep(made)
        return made

    # All that the report depends on besides the data: with anything else it must be made anew.
    asked = (folder.path.resolve().name, rehearsals, named, shown, figures)
    rig = fitted_calibration(folder.path)
    try:
        return keep.made(make, Written, before, text, unlocked, rig, asked)
    except _NotToKeep as error:
        return error.made


_MOST_KEPT = 2**25
"""Bytes of a report that is kept whole; of a larger one the tests, fits and figures are kept."""


def _made(
    folder: "StudyFolder",
    *,
    rehearsals: bool,
    named: tuple[str, ...] | None,
    figures: bool,
    alone: bool,
) -> Written:
    from analysis.loading.sessions import load_sessions
    from analysis.loading.study_data import marks, study_data
    from analysis.report.page import require_sections
    from analysis.report.report import FIGURE_FILES, asks_for_multiverse, report_files
    from analysis.report.sections.registration import registered_lines
    from analysis.report.sections.session_checks import left_out_lines
    from analysis.report.table4_text import table4_lines
    from analysis.report.wording import omnibus_line
    from runner.journal.verification import readable_chains

    shown = folder.report_sections() if named is None else named
    # Before anything is read, which may take long.
    require_sections(shown or ())
    broken: list[str] = []
    with study_journal(folder) as journal:
        study = folder.study()
        readable, sessions = readable_chains(journal, broken), len(journal.sessions())
        chains = followed("sessions", readable, sessions, alone=alone)
        recorded = load_sessions(chains)
    data = study_data(recorded, rehearsals=rehearsals, rules=study.exclusions)
    kept = recorded if asks_for_multiverse(shown) else None
    del recorded  # it may be large
    result = made_report(
        folder, study, data, broken, rehearsals=rehearsals, named=named, recorded=kept
    )
    table4 = table4_lines(result.table.main.table4, "–", marks(result.loaded.empty))
    return Written(
        files=report_files(result, figures=figures),
        figure_files=tuple(sorted(FIGURE_FILES)),
        table4=tuple(map(tuple, table4)),
        lines=(
            *result.table_notes,
            omnibus_line(result.table.main),
            *registered_lines(result),
            *left_out_lines(data),
        ),
        broken=tuple(broken),
    )


def warn_of_broken(sessions: "Sequence[str]", study: Path) -> None:
    """Warn that the journal of these sessions was changed, if there are any."""
    if not sessions:
        return
    named = ", ".join(sessions[:10]) + (f" and {len(sessions) - 10} more" if sessions[10:] else "")
    complain(
        f"touchbeam: warning: the journal was modified outside touchbeam, in {named}; "
        f"see touchbeam verify {study}"
    )
