"""The export as Psych-DS has it: tables with keywords in their names, described in JSON-LD.

Psych-DS 1.5.0; the terms are those of schema.org.
"""

from typing import Any

from analysis.cells import csv_cell, csv_text, json_text
from analysis.export.dataset import Dataset, known
from analysis.export.readme import readme
from analysis.export.trial_table import cells
from protocol.study.columns import Column, names_of

SCHEMA_VERSION = "Psych-DS 1.5.0"

_TABLES = (
    "This is a Psych-DS data set. Each session is a table `data/*_data.csv`; "
    "`dataset_description.json` describes its columns. An empty cell is a missing value. An "
    "apostrophe before `=`, `+`, `-` or `@` keeps spreadsheets from taking a text for a formula."
)


def psychds_export(data: Dataset) -> dict[str, str]:
    """Return the files of a Psych-DS data set by path.

    What only the study's author knows stands there if the study file gives it, and else not at
    all. A participant without trials is not there.
    """
    return {
        "README.md": readme(data, _TABLES),
        "dataset_description.json": json_text(_dataset_description(data)),
        **_sessions(data),
    }


def _sessions(data: Dataset) -> dict[str, str]:
    files: dict[str, str] = {}
    names = names_of(data.shared_columns)
    for (who, number), trials in data.by_session():
        session = f"_session-{number}" if data.several_sessions else ""
        path = f"data/subject-{data.subject_labels[who]}{session}_task-{data.task}_data.csv"
        files[path] = csv_text(names, cells(trials[names]))
    return files


def _dataset_description(data: Dataset) -> dict[str, Any]:
    facts = data.facts
    organisation = {
        "@type": "Organization",
        "name": facts.institution,
        "address": facts.institution_address,
    }
    described = {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": data.title,
        "description": data.description(),
        "schemaVersion": SCHEMA_VERSION,
        "author": [{"@type": "Person", "name": name} for name in facts.authors],
        "license": facts.licence,
        "funder": list(facts.funding),
        "citation": list(facts.references),
        "identifier": facts.doi,
        "keywords": list(facts.keywords),
        "sourceOrganization": known(organisation) if facts.institution is not None else None,
        "creativeWorkStatus": "contains rehearsals" if "rehearsal" in data.kinds else None,
        "isBasedOn": f"study journal, SHA-256 of its events {data.source_sha256}",
        "variableMeasured": [_variable(column, data) for column in data.shared_columns],
    }
    return known(described)


def _variable(column: Column, data: Dataset) -> dict[str, Any]:
    terms = [
        # A level is written as in a cell, so that readers find one by the other.
        {"@type": "DefinedTerm", "name": csv_cell(level), "description": meaning}
        for level, meaning in data.levels(column).items()
    ]
    # No field says that a cell may hold several of them, so that words do.
    listed = f" {column.of_lists} Semicolons stand between." if column.of_lists else ""
    return known(
        {
            "@type": "PropertyValue",
            "name": csv_cell(column.name),
            "description": data.meaning(column) + listed,
            "unitText": column.unit,
            "valueReference": terms,
        }
    )
