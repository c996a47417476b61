"""What validators of data sets let through, looked for by hand."""

import csv
import io
import json
import re
from collections.abc import Iterator, Mapping

ENTITIES = re.compile(
    r"sub-(?P<sub>[0-9A-Za-z]+)/(ses-(?P<ses>[0-9A-Za-z]+)/)?beh/"
    r"sub-(?P=sub)(_ses-(?P=ses))?_task-(?P<task>[0-9A-Za-z]+)_(beh|events)\.(tsv|json)"
)
BIDS_ROOT = {"README.md", "dataset_description.json", "participants.json", "participants.tsv"}
PSYCHDS_ROOT = {"README.md", "dataset_description.json"}
PSYCHDS_NAME = re.compile(r"data/([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv")
PSYCHDS_KEYWORDS = {"study", "site", "subject", "session", "task", "condition", "trial", "stimulus"}
SCHEMA_ORG_DATASET = {
    "@context",
    "@type",
    "name",
    "description",
    "schemaVersion",
    "author",
    "license",
    "funder",
    "citation",
    "identifier",
    "keywords",
    "sourceOrganization",
    "creativeWorkStatus",
    "isBasedOn",
    "variableMeasured",
}


def text_slips(files: Mapping[str, str]) -> Iterator[str]:
    """Yield what is wrong with the text of any file."""
    for path, text in files.items():
        if "\r" in text:
            yield f"{path}: CR"
        if text.startswith("\ufeff"):
            yield f"{path}: BOM"
        if not text.endswith("\n"):
            yield f"{path}: the last line has no end"


def bids_slips(files: Mapping[str, str]) -> Iterator[str]:
    """Yield what is wrong with a BIDS data set."""
    yield from text_slips(files)
    tables = {path: text for path, text in files.items() if path.endswith(".tsv")}
    for path, text in tables.items():
        yield from _tsv_slips(path, text)
    listed = {row["participant_id"] for row in tsv_rows(files["participants.tsv"])}
    with_data = {
        path.split("/")[0]
        for path, text in tables.items()
        if path.endswith("_beh.tsv") and tsv_rows(text)
    }
    for who in sorted(listed ^ with_data):
        yield f"{who}: {'no data' if who in listed else 'not in participants.tsv'}"
    for path in sorted(files.keys() - BIDS_ROOT):
        yield from _task_slips(path, files)


def _task_slips(path: str, files: Mapping[str, str]) -> Iterator[str]:
    named = ENTITIES.fullmatch(path)
    if named is None:
        yield f"{path}: stray"
        return
    sidecar = json.loads(files[re.sub(r"\.tsv$", ".json", path)])
    if re.sub(r"[^0-9A-Za-z]", "", sidecar["TaskName"]) != named["task"]:
        yield f"{path}: the task is called {sidecar['TaskName']!r} inside"
    if path.endswith(".tsv"):
        for column in set(files[path].split("\n", 1)[0].split("\t")) - sidecar.keys():
            yield f"{path}: {column} is not described"


def _tsv_slips(path: str, text: str) -> Iterator[str]:
    lines = text.splitlines()
    widths = {line.count("\t") for line in lines}
    if widths == {0}:
        yield f"{path}: no tabs"
    elif len(widths) > 1 or len(lines) != text.count("\n"):
        yield f"{path}: ragged"
    if any(cell == "" for line in lines for cell in line.split("\t")):
        yield f"{path}: an empty cell"


def psychds_slips(files: Mapping[str, str]) -> Iterator[str]:
    """Yield which rules of Psych-DS a data set breaks."""
    yield from text_slips(files)
    described = json.loads(files["dataset_description.json"])
    if (described["@context"], described["@type"]) != ("https://schema.org/", "Dataset"):
        yield "dataset_description.json: is no schema.org Dataset"
    for term in described.keys() - SCHEMA_ORG_DATASET:
        yield f"dataset_description.json: {term} is no term of schema.org"
    for term in {"name", "description", "variableMeasured"} - described.keys():
        yield f"dataset_description.json: {term} is missing"
    variables = [variable["name"] for variable in described["variableMeasured"]]
    tables = sorted(files.keys() - PSYCHDS_ROOT)
    if not tables:
        yield "data: no table"
    for path in tables:
        yield from _psychds_table_slips(path, files[path], variables)


def _psychds_table_slips(path: str, text: str, variables: list[str]) -> Iterator[str]:
    if not PSYCHDS_NAME.fullmatch(path):
        yield f"{path}: breaks the rule for names"
    keywords = {part.split("-")[0] for part in path.removeprefix("data/").split("_")[:-1]}
    for keyword in keywords - PSYCHDS_KEYWORDS:
        yield f"{path}: {keyword} is no keyword"
    header, *rows = list(csv.reader(io.StringIO(text)))
    if sorted(header) != sorted(variables):
        yield f"{path}: columns and variableMeasured differ"
    if any(len(row) != len(header) for row in rows) or not rows:
        yield f"{path}: ragged or empty"


def tsv_rows(text: str) -> list[dict[str, str]]:
    """Return the rows of a TSV table, in which quotes mean nothing."""
    header, *lines = [line.split("\t") for line in text.splitlines()]
    return [dict(zip(header, line, strict=True)) for line in lines]


def csv_rows(text: str) -> list[dict[str, str]]:
    """Return the rows of a CSV table."""
    return list(csv.DictReader(io.StringIO(text, newline="")))
