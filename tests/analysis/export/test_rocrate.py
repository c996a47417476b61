"""Exported RO-Crates: valid by the validator, each file described, nothing invented."""

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from analysis.export.dataset import Dataset
from analysis.export.rocrate import METADATA, crate_metadata, rocrate_export
from protocol.journal.shared_form import FOLDER
from protocol.study.columns import COLUMNS
from tests.analysis.export.data_slips import csv_rows, text_slips
from tests.analysis.export.test_formats import nasty, published, written

Check = Callable[[Path], dict[str, set[str]]]
NOBODY_KNOWS = {
    "The `publisher` property of a `Root Data Entity` SHOULD be an `Organization`",
    "The SoftwareApplication id SHOULD be an absolute URI",
    "The Application SHOULD have a url",
    "The Action SHOULD have an agent that is a Person or Organization",
    "The Action SHOULD have an endTime in ISO 8601 format",
    "The organization SHOULD have a URL.",
    "The author SHOULD have an organizational affiliation.",
    "The author SHOULD have a Contextual Entity which specifies the organizational `affiliation`.",
}
"""What the validator misses where the study file gives all it can: it has no place for a publisher,
for addresses in the web and for authors' affiliations, and when sessions ended stays behind."""
ONLY_THE_AUTHOR_KNOWS = NOBODY_KNOWS | {
    "The Root Data Entity SHOULD have a link to a Contextual Entity representing the `author` of "
    "the RO-Crate",
    "The Root Data Entity SHOULD have a link to a Contextual Entity representing the "
    "schema_org:license type",
}


@pytest.fixture
def check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Check:
    from tests.analysis.export.crate_validator import complaints

    return lambda crate: complaints(crate, monkeypatch, tmp_path / "cache")


def crate(data: Dataset) -> dict[str, str]:
    files = {
        **rocrate_export(data),
        "recordings/P01_session-1.csv": "t_s\n",
        f"{FOLDER}/study.toml": "",
        f"{FOLDER}/sub-P01.jsonl": "",
        f"{FOLDER}/sub-P02.jsonl": "",
        "report/report.html": "<p>",
        "report/figures/scores.svg": "<svg/>",
    }
    contents = {name: text.encode() for name, text in files.items()}
    return {**files, METADATA: crate_metadata(data, contents, date(2026, 11, 22))}


def entities(files: dict[str, str]) -> dict[str, Any]:
    return {entity["@id"]: entity for entity in json.loads(files[METADATA])["@graph"]}


@pytest.mark.parametrize(
    ("data", "allowed"),
    [
        (lambda: nasty(rehearsals=True), NOBODY_KNOWS),
        (lambda: nasty(publication=False), ONLY_THE_AUTHOR_KNOWS),
        (lambda: published("1", "受试者", "=cmd()"), NOBODY_KNOWS),
    ],
    ids=["nasty", "nasty without facts", "published"],
)
def test_the_validator_finds_no_error(
    data: Callable[[], Dataset], allowed: set[str], check: Check, tmp_path: Path
) -> None:
    found = check(written(crate(data()), tmp_path / "crate"))
    assert found["REQUIRED"] == set()
    assert found["RECOMMENDED"] <= allowed


def test_the_validator_would_find_an_error(check: Check, tmp_path: Path) -> None:
    files = crate(nasty())
    graph = list(entities(files).values())
    del next(entity for entity in graph if entity["@id"] == "#export")["instrument"]
    del next(entity for entity in graph if entity["@id"] == "./")["datePublished"]
    next(entity for entity in graph if entity["@id"] == "trials.csv")["frobs"] = "7"
    described = {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}
    folder = written({**files, METADATA: json.dumps(described)}, tmp_path / "crate")
    (folder / "trials.json").unlink()
    found = " ".join(check(folder)["REQUIRED"])
    for part in ("instrument", "datePublished", "frobs", "trials.json"):
        assert part in found


def test_another_program_reads_the_crate(tmp_path: Path) -> None:
    from rocrate.rocrate import ROCrate

    files = crate(nasty())
    read = ROCrate(written(files, tmp_path / "crate"))
    assert {entity.id for entity in read.data_entities} == files.keys() - {METADATA}
    assert read.name == 'Touch, "felt" 触觉'
    assert [person["name"] for person in read.root_dataset["author"]] == ["Surname, Given", "姓名"]


def test_each_file_says_what_it_is() -> None:
    files = crate(nasty())
    known = entities(files)
    for name in files.keys() - {METADATA}:
        assert known[name].keys() == {
            *("@id", "@type", "name", "description", "encodingFormat", "contentSize")
        }, name
        assert known[name]["contentSize"] == str(len(files[name].encode()))


def test_sessions_and_export_are_linked_with_the_version_that_made_them() -> None:
    known = entities(crate(nasty()))
    events = [{"@id": f"{FOLDER}/sub-P0{number}.jsonl"} for number in (1, 2)]
    assert known["#sessions"]["object"] == {"@id": f"{FOLDER}/study.toml"}
    assert known["#sessions"]["result"] == events
    assert known["#export"]["object"] == [{"@id": f"{FOLDER}/study.toml"}, *events]
    assert {"@id": "report/report.html"} in known["#export"]["result"]
    assert known[known["#export"]["instrument"]["@id"]]["softwareVersion"] == "0"
    for reference in known["./"]["mentions"]:
        assert known[reference["@id"]]["@type"] == "CreateAction"


def test_a_published_table_had_no_session() -> None:
    known = entities(crate(published("1")))
    assert "#sessions" not in known
    assert known["./"]["mentions"] == {"@id": "#export"}


def test_nothing_is_invented() -> None:
    known = entities(crate(nasty(publication=False)))
    assert known["./"]["license"].startswith("The study names no licence")
    assert not known["./"].keys() & {"author", "citation", "funder", "identifier", "keywords"}
    assert not {"Person", "Organization"} & {entity["@type"] for entity in known.values()}


def test_a_licence_may_be_an_address() -> None:
    data = nasty()
    address = "https://creativecommons.org/publicdomain/zero/1.0/"
    facts = data.facts.model_copy(update={"licence": address})
    study = data.study.model_copy(update={"publication": facts})
    data = replace(data, study=study)
    assert entities(crate(data))["./"]["license"] == {"@id": address}
    assert entities(crate(nasty()))["#licence"]["name"] == "CC0"


def test_what_is_private_is_not_in_the_tables() -> None:
    files = rocrate_export(nasty())
    private = {column.name for column in COLUMNS if column.private}
    assert private
    assert not private & csv_rows(files["trials.csv"])[0].keys()
    assert not private & json.loads(files["trials.json"]).keys()
    assert list(text_slips(files)) == []
