"""The export as the Brain Imaging Data Structure has it, for behavioural data.

Brain Imaging Data Structure 1.11.1, "Behavioral experiments (with no neural recordings)".
"""

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from analysis.cells import BETWEEN_TOUCHES, json_text, tsv_cell, tsv_text
from analysis.export.dataset import Dataset, known
from analysis.export.readme import readme
from analysis.export.recordings import DRIVEN, MEASURED, described, tsv_gz
from analysis.export.trial_table import cells, of_tracks
from analysis.loading.records import values
from protocol.study.columns import BY_NAME, Column

BIDS_VERSION = "1.11.1"
HED_VERSION = "8.3.0"
"""Of Hierarchical Event Descriptors, which say the kind of an event in words of programs."""

_TABLES = (
    "This is a BIDS data set. Each session is a table `sub-*/beh/*_beh.tsv` "
    "(`sub-*/ses-*/beh/` if there are several sessions); the JSON file beside it describes its "
    "columns.{events} "
    "`n/a` is a missing value; in a text `\\t`, `\\n` and `\\\\` stand for a tab, a line "
    "feed and a backslash; an apostrophe before `=`, `+`, `-` or `@` keeps spreadsheets from "
    "taking a text for a formula. `participants.tsv` gives each participant's pseudonym, and the "
    "answers that were given once."
)

_EVENTS = " `*_events.tsv` has the trials as events, tagged in words of HED."

_RECORDINGS = (
    " What was recorded during touches is beside the tables: forces and place in "
    "`*_physio.tsv.gz`, the drive in `*_stim.tsv.gz`; `recording-trial3touch0` is the first touch "
    "of the trial with the index 3."
)

_TOUCH = "Sensory-event, Tactile-presentation"
_HED = {
    "baseline": f"{_TOUCH}, Label/Baseline",
    "signal": f"{_TOUCH}, Label/Signal",
    "practice": f"{_TOUCH}, Label/Practice",
    "trial": f"{_TOUCH}, Experimental-stimulus, Target",
    "catch": f"{_TOUCH}, Experimental-stimulus, Non-target",
}
"""By kind of trial."""
_KINDS = BY_NAME["trial_kind"]
_EVENT_COLUMNS = (
    Column("onset", "When the trial began, from the first one's beginning.", "s"),
    Column("duration", "From the trial's beginning to its last answer; missing without one.", "s"),
    Column("trial_type", _KINDS.description, levels={kind: _KINDS.levels[kind] for kind in _HED}),
    Column("response_time", "From the question to the answer.", "s"),
    BY_NAME["trial_index"],
)
_OF_TRACKS = ("track", "track_role", "level", "level_value", "interval", "correct", "reversal")
"""Columns of events where there are tracks."""
_NAMES = """
acquisition ceagent chunk datatype direction echo extension flip fmap inv modality mt nucleus part
proc reconstruction recording run sample scans session space staining subject suffix task tracer
tracksys volume
"""
_ENTITIES = frozenset(_NAMES.split())
"""What names of files say in BIDS. PyBIDS takes a key of a sidecar for one, its plural, too."""
_NAMED_HERE = {
    "direction": "touch_direction",
    "session": "session_number",
    "sessions": "session_count",
}


def bids_export(data: Dataset) -> dict[str, str]:
    """Return the files of a BIDS data set by path.

    What only the study's author knows stands there if the study file gives it, and else not at
    all. A participant without trials is not there.
    """
    tables = _TABLES.format(events="" if data.published else _EVENTS)
    return {
        "README.md": readme(data, tables + _RECORDINGS * any(data.recorded.values())),
        "dataset_description.json": json_text(_dataset_description(data)),
        **_participants(data),
        **_sessions(data),
    }


def _dataset_description(data: Dataset) -> dict[str, Any]:
    facts = data.facts
    bare = facts.doi is not None and facts.doi.startswith("10.")
    doi = f"doi:{facts.doi}" if bare else facts.doi  # BIDS asks for a URI
    return known(
        {
            "Name": data.title,
            "BIDSVersion": BIDS_VERSION,
            "HEDVersion": HED_VERSION,
            # Scores as they were given: what is predicted or fitted is left out.
            "DatasetType": "raw",
            "License": facts.licence,
            "Authors": facts.authors,
            "Keywords": facts.keywords,
            "Funding": facts.funding,
            "EthicsApprovals": facts.ethics_approvals,
            "ReferencesAndLinks": facts.references,
            "DatasetDOI": doi,
            "GeneratedBy": [{"Name": "touchbeam", "Version": data.touchbeam}],
            "SourceDatasets": [{"Version": f"sha256:{data.source_sha256}"}],
        }
    )


def _participants(data: Dataset) -> dict[str, str]:
    """Return the table of participants and its sidecar; the label stands first."""
    first, *others = data.participant_columns
    named = {"pseudonym": first} | _named(others)
    rows = [(f"sub-{data.subject_labels[str(row[0])]}", *row) for row in cells(data.participants)]
    return {
        "participants.json": json_text({name: _described(it, data) for name, it in named.items()}),
        "participants.tsv": tsv_text(["participant_id", *named], rows),
    }


def _named(columns: Iterable[Column]) -> dict[str, Column]:
    """Return columns by their names here, which are not those of entities."""
    by_name = {column.name: column for column in columns}
    taken = by_name.keys() | _NAMED_HERE.values()
    named = {}
    for name, column in by_name.items():
        here = _NAMED_HERE.get(name, name)
        # A question may be named `run`; PyBIDS would then look for the run in the file's name.
        if here in _ENTITIES or here.removesuffix("s") in _ENTITIES:
            here += "_answer"
            while here in taken:
                here += "_"
        named[tsv_cell(here)] = column
    return named


def bids_recordings(data: Dataset) -> dict[str, bytes]:
    """Return what was recorded: two tables for each touch, measured and driven, with sidecars."""
    files: dict[str, bytes] = {}
    for (who, number), touches in data.recorded_by_session():
        for touch in touches:
            recording = f"recording-trial{touch.trial_index}touch{touch.touch}"
            stem = f"{_stem(data, who, number)}_{recording}"
            for suffix, own, rows in (
                ("physio", MEASURED, touch.measured()),
                ("stim", DRIVEN, touch.driven()),
            ):
                columns = {it.name: _described(it, data) for it in own}
                files[f"{stem}_{suffix}.tsv.gz"] = tsv_gz([*columns], rows)
                # BIDS has a type of its own for eye tracking alone.
                kind = {"PhysioType": "generic"} if suffix == "physio" else {}
                sidecar = {"TaskName": data.task_name, **kind, **described(touch, columns)}
                files[f"{stem}_{suffix}.json"] = json_text(sidecar).encode()
    return files


def _stem(data: Dataset, who: str, number: int) -> str:
    """Return the path of a session's files, without suffix."""
    entities = data.entities(who, number)
    return "/".join([*entities, "beh", "_".join([*entities, f"task-{data.task}"])])


def _sessions(data: Dataset) -> dict[str, str]:
    """Return each session's tables of trials and of events, and their sidecars."""
    files: dict[str, str] = {}
    named = _named(data.shared_columns)
    columns = {name: _described(column, data) for name, column in named.items()}
    names = [column.name for column in named.values()]
    for (who, number), trials in data.by_session():
        stem = _stem(data, who, number)
        files[f"{stem}_beh.tsv"] = tsv_text(list(columns), cells(trials[names]))
        task = _task(data, trials)
        files[f"{stem}_beh.json"] = json_text({**task, **columns})
        files |= _event_files(stem, trials, task, data)
    return files


def _event_files(
    stem: str, trials: pd.DataFrame, task: Mapping[str, Any], data: Dataset
) -> dict[str, str]:
    """Return the table of a session's events, in the order of time, and its sidecar.

    Imported scores are no events. `task` is what each sidecar of the session says of it.
    """
    # UTC, because the monotonic clock begins anew when an interrupted session goes on.
    timed = trials[trials["started_utc"].notna()]
    if timed.empty:
        return {}
    began = pd.to_datetime(timed["started_utc"])
    table = timed.assign(onset=(began - began.min()).dt.total_seconds()).sort_values("onset")
    names = ["onset", "duration_s", "trial_kind", "reaction_time_s", "trial_index"]
    told, hed = {it.name: _described(it, data) for it in _EVENT_COLUMNS}, _HED
    if of_tracks(data.tables.found):
        names += _OF_TRACKS
        hed = {**_HED, "track": _HED["trial"]}
        columns = {it.name: _described(it, data) for it in data.columns}
        kinds = columns["trial_kind"]["Levels"]
        told["trial_type"]["Levels"] = {kind: kinds[kind] for kind in hed}
        told |= {name: columns[name] for name in _OF_TRACKS}
    told["trial_type"]["HED"] = hed
    rows = zip(*(values(table[name]) for name in names), strict=True)
    software = {
        "SoftwareName": "touchbeam",
        "SoftwareVersion": values(table["touchbeam_version"])[0],
    }
    return {
        f"{stem}_events.tsv": tsv_text(list(told), rows),
        f"{stem}_events.json": json_text({**task, "StimulusPresentation": known(software), **told}),
    }


def _task(data: Dataset, trials: pd.DataFrame) -> dict[str, Any]:
    """Return what the sidecars of a session say of its task."""
    facts = data.facts
    task = {
        "TaskName": data.task_name,
        "TaskDescription": data.description(),
        "Instructions": data.instructions(values(trials["language"])[0]),
        "InstitutionName": facts.institution,
        "InstitutionAddress": facts.institution_address,
    }
    return known(task)


def _described(column: Column, data: Dataset) -> dict[str, Any]:
    """Return a column as a sidecar describes it.

    Readers take `Units` to mean one number and `Levels` to mean one of them, so that a column with
    lists says both in words.
    """
    if column.of_lists:
        unit = f" Unit: {column.unit}." if column.unit else ""
        words = "; ".join(f"{level} ({meaning})" for level, meaning in column.levels.items())
        levels = f" {words}." if words else ""
        text = f"{data.meaning(column)} {column.of_lists}{unit}{levels}"
        return {"Description": text, "Delimiter": BETWEEN_TOUCHES}
    return known(
        {
            "Description": data.meaning(column),
            "Units": column.unit,
            # As in a cell of the table, so that validators find each value among the levels.
            "Levels": {tsv_cell(level): text for level, text in data.levels(column).items()},
        }
    )
