"""The export as a research object: a folder that tells of each file what it is and what made it.

RO-Crate 1.1 with the profile Process Run Crate 0.5, in JSON-LD with the terms of schema.org.
"""

from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from pathlib import PurePosixPath
from typing import Any

from analysis.cells import json_text
from analysis.export.csv_tables import csv_tables
from analysis.export.dataset import Dataset, known
from analysis.export.readme import readme
from analysis.loading.records import CHANGED, values
from protocol.journal.shared_form import FOLDER, REGISTRATION_FILE, STUDY_FILE, SUFFIX

METADATA = "ro-crate-metadata.json"
REPORT = "report"
"""The folder of the study's report."""
_CRATE = "https://w3id.org/ro/crate/1.1"
_PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
_STUDY = f"{FOLDER}/{STUDY_FILE}"
_REGISTRATION = f"{FOLDER}/{REGISTRATION_FILE}"
_SETTLED = (_STUDY, _REGISTRATION)
"""What was there before the sessions."""
_NO_LICENCE = "The study names no licence; ask its authors before you use these data."
"""An RO-Crate must say how it may be used; nobody has said so."""

_TABLES = (
    f"This is an [RO-Crate](https://w3id.org/ro/crate): `{METADATA}` names each file, and the "
    "version of the software that made it. `trials.csv` has the trials, `touches.csv` their "
    "touches, `contrasts.csv` what each friction law predicts for them, `participants.csv` the "
    "participants, and the JSON file beside each describes its columns. "
    "An empty cell is a missing value; an apostrophe before `=`, `+`, `-` or `@` keeps "
    f"spreadsheets from taking a text for a formula. `{FOLDER}/` has the study file and the "
    "journal, a file of events for each session: `touchbeam import` makes a study of them again. "
    f"`{REPORT}/report.html` is its report. What the operator noted, references of consents and "
    "the time of day are not here."
)

_MEDIA = {
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".jsonl": "application/jsonl",
    ".md": "text/markdown",
    ".pdf": "application/pdf",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".tex": "application/x-tex",
    ".toml": "application/toml",
}
_MEANINGS = {
    "README.md": "What is here, how to read it, and what is not here.",
    "trials.csv": "A row for each trial that was begun.",
    "touches.csv": "A row for each touch of these trials.",
    "contrasts.csv": "A row for each trial and friction law: the predicted contrast of friction.",
    "participants.csv": "A row for each participant, with the answers that were given once.",
    **{
        f"{table}.json": f"Meaning, unit and levels of each column of {table}.csv."
        for table in ("trials", "touches", "contrasts", "participants")
    },
    "recordings/recordings.json": "Meaning and unit of each column of the other files here.",
    _STUDY: "The study file, with the study's own languages.",
    _REGISTRATION: "What was registered before the first session; its digest seeds the orders.",
    f"{REPORT}/report.html": "The study's report: Table 4, statistics and figures.",
    f"{REPORT}/report.json": "Every number of the report.",
}
_MEANINGS_BELOW = {
    "recordings": "What was recorded during the touches of a session, a row for each sample.",
    FOLDER: "The journal's events of a session, without notes, consents and the time of day.",
    f"{REPORT}/figures": "A figure of the report.",
    REPORT: "A table of the report.",
}


def rocrate_export(data: Dataset) -> dict[str, str]:
    """Return the tables and the README, by path; `crate_metadata` describes them."""
    return {"README.md": readme(data, _TABLES), **csv_tables(data, shared=True)}


def crate_metadata(data: Dataset, files: Mapping[str, bytes], today: date) -> str:
    """Return the text of `ro-crate-metadata.json`.

    What only the study's author knows stands there if the study file gives it.

    Args:
        data: what is exported.
        files: all other files of the crate.
        today: when it is made.
    """
    facts = data.facts
    persons = [_named(f"#author-{n}", "Person", name) for n, name in enumerate(facts.authors, 1)]
    texts = [
        _named(f"#reference-{n}", "CreativeWork", text)
        for n, text in enumerate(facts.references, 1)
    ]
    places: list[dict[str, Any]] = []
    if facts.institution:
        address = known({"address": facts.institution_address})
        places = [_named("#institution", "Organization", facts.institution) | address]
    licence = [_licence(facts.licence)] if facts.licence else []
    actions = _actions(data, files, today)
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": data.title,
        "description": data.description(),
        # RO-Crate requires a date, which makes it the one format that differs from day to day.
        "datePublished": today.isoformat(),
        "license": _references(licence) or _NO_LICENCE,
        "conformsTo": {"@id": _PROFILE},
        "author": _references(persons),
        "sourceOrganization": _references(places),
        "citation": _references(texts),
        "keywords": _one_or_list(facts.keywords),
        "funder": _one_or_list(facts.funding),
        "identifier": facts.doi,
        "creativeWorkStatus": "contains rehearsals" if "rehearsal" in data.kinds else None,
        "hasPart": _references({"@id": path} for path in files),
        "mentions": _references(actions),
    }
    profile = _named(_PROFILE, "CreativeWork", "Process Run Crate")
    graph = [
        {
            # RO-Crate requires this entity: by it a reader finds the root of the crate.
            "@id": METADATA,
            "@type": "CreativeWork",
            "about": {"@id": "./"},
            "conformsTo": {"@id": _CRATE},
        },
        known(root),
        {**profile, "version": _PROFILE.rpartition("/")[2]},
        *licence,
        *persons,
        *places,
        *texts,
        *(_application(version) for version in dict.fromkeys([*_ran(data), data.touchbeam])),
        *actions,
        *(_file(path, content) for path, content in files.items()),
    ]
    return json_text({"@context": f"{_CRATE}/context", "@graph": graph})


def _actions(data: Dataset, files: Mapping[str, bytes], today: date) -> list[dict[str, Any]]:
    """Return what was done: the sessions, unless their scores were published, and the export."""
    events = [path for path in files if path.endswith(SUFFIX)]
    source = [path for path in files if path in _SETTLED]
    made = [path for path in files if path not in {*events, *source}]
    export = _named("#export", "CreateAction", "Export") | {
        "description": "touchbeam made the tables and the report of the study and its journal.",
        "endTime": today.isoformat(),
        "instrument": _references([_application(data.touchbeam)]),
        "object": _references({"@id": path} for path in (*source, *events)),
        "result": _references({"@id": path} for path in made),
    }
    sessions = _named("#sessions", "CreateAction", "Sessions") | {
        "description": "touchbeam ran the sessions and kept a journal of their events.",
        "instrument": _references(map(_application, _ran(data))),
        "object": _references({"@id": path} for path in source),
        "result": _references({"@id": path} for path in events),
    }
    # Published scores were recorded without touchbeam.
    return [known(action) for action in (sessions, export) if action["instrument"]]


def _ran(data: Dataset) -> list[str]:
    """Return the versions of touchbeam that ran the sessions."""
    told = CHANGED.join(values(data.tables.flat["touchbeam_version"].dropna().drop_duplicates()))
    return list(dict.fromkeys(told.split(CHANGED))) if told else []


def _application(version: str) -> dict[str, str]:
    application = _named(f"#touchbeam-{version}", "SoftwareApplication", "touchbeam")
    return {**application, "softwareVersion": version}


def _file(path: str, content: bytes) -> dict[str, Any]:
    place = PurePosixPath(path)
    # From the nearest folder outwards, so that figures are not described as tables.
    below = (_MEANINGS_BELOW.get(str(folder)) for folder in place.parents)
    facts = {
        **_named(path, "File", place.name),
        "description": _MEANINGS.get(path) or next(filter(None, below), None),
        "encodingFormat": _MEDIA.get(place.suffix),
        "contentSize": str(len(content)),
    }
    return known(facts)


def _licence(named: str) -> dict[str, str]:
    # RO-Crate wants the licence's address for its identifier; a name alone gets one of its own.
    is_address = named.startswith(("https://", "http://")) and " " not in named
    return _named(named if is_address else "#licence", "CreativeWork", named)


def _named(identifier: str, kind: str, name: str) -> dict[str, Any]:
    return {"@id": identifier, "@type": kind, "name": name}


def _references(entities: Iterable[Mapping[str, Any]]) -> Any:
    return _one_or_list([{"@id": entity["@id"]} for entity in entities])


def _one_or_list(items: Sequence[Any]) -> Any:
    """Return the items as JSON-LD has them in its compact form: one stands without a list."""
    return items[0] if len(items) == 1 else list(items)
