"""Exported data sets: valid by the official validator, whole, always the same, nothing invented."""

import json
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis.export.bids import bids_export
from analysis.export.dataset import Dataset, dataset
from analysis.export.formats import EXPORTS, csv_export
from analysis.export.psychds import psychds_export
from analysis.loading.study_data import load_study_data
from protocol.journal.events import StoredEvent
from protocol.study.columns import COLUMNS, TAKEN
from protocol.study_file.loading import parsed_study
from tests.analysis.chains import published_chain
from tests.analysis.export.data_slips import (
    bids_slips,
    csv_rows,
    psychds_slips,
    text_slips,
    tsv_rows,
)
from tests.analysis.export.test_factor_columns import ONCE, exported, session
from tests.analysis.hostile_study import NAMES, Written, sessions, study_text

if TYPE_CHECKING:
    from bids.layout import BIDSLayout

bids, psychds, csv = map(cache, (bids_export, psychds_export, csv_export))
"""An export that several tests look at is made once."""
VALIDATOR = str(Path(sys.executable).with_name("bids-validator-deno"))
ONLY_THE_AUTHOR_KNOWS = {
    ("TOO_FEW_AUTHORS", None),
    ("NO_AUTHORS", "Authors"),
    ("JSON_KEY_RECOMMENDED", "License"),
    ("SIDECAR_KEY_RECOMMENDED", "CogAtlasID"),
    ("SIDECAR_KEY_RECOMMENDED", "CogPOID"),
    ("SIDECAR_KEY_RECOMMENDED", "InstitutionName"),
    ("SIDECAR_KEY_RECOMMENDED", "InstitutionAddress"),
    ("SIDECAR_KEY_RECOMMENDED", "InstitutionalDepartmentName"),
}
"""What the validator may miss where the study file does not give it."""
NOBODY_SAID = {
    ("SIDECAR_KEY_RECOMMENDED", "CogAtlasID"),
    ("SIDECAR_KEY_RECOMMENDED", "CogPOID"),
    ("SIDECAR_KEY_RECOMMENDED", "InstitutionalDepartmentName"),
}
"""What it misses where the study file gives all it can."""


@cache
def nasty(*, rehearsals: bool = False, publication: bool = True) -> Dataset:
    text = study_text() if publication else study_text(publication="")
    chains = [session.events for session in sessions(text)]
    return dataset(chains, parsed_study(text), "0", rehearsals=rehearsals)


@cache
def published(*subjects: str) -> Dataset:
    chains = [published_chain(who, {"voltage": 9.0, "pressure": None}) for who in subjects]
    return dataset(chains, parsed_study(study_text()), "0", rehearsals=False)


def written(files: Mapping[str, str], folder: Path) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(text.encode())
    return folder


def complaints(folder: Path) -> list[dict[str, str]]:
    """What the official validator has to say."""
    said = subprocess.run(
        [VALIDATOR, str(folder), "--format", "json"], capture_output=True, text=True, check=False
    )
    found: list[dict[str, str]] = json.loads(said.stdout)["issues"]["issues"]
    return found


def warnings(folder: Path) -> set[tuple[str, str | None]]:
    """The validator's warnings, once it is sure that there is no error."""
    found = complaints(folder)
    assert [entry for entry in found if entry["severity"] == "error"] == []
    return {(entry["code"], entry.get("subCode")) for entry in found}


@pytest.mark.parametrize(
    ("data", "allowed"),
    [
        (lambda: nasty(rehearsals=True), NOBODY_SAID),
        (lambda: nasty(publication=False), ONLY_THE_AUTHOR_KNOWS),
        (
            lambda: published("1", "受试者", "=cmd()"),
            {*NOBODY_SAID, ("SIDECAR_KEY_RECOMMENDED", "Instructions")},
        ),
    ],
    ids=["nasty", "nasty without facts", "published"],
)
def test_the_official_validator_finds_no_error(
    data: Callable[[], Dataset], allowed: set[tuple[str, str]], tmp_path: Path
) -> None:
    assert warnings(written(bids(data()), tmp_path / "bids")) == allowed


def entities() -> list[str]:
    from bids.layout import Config

    return sorted(Config.load("bids").entities)


def as_pybids_reads(folder: Path) -> "BIDSLayout":
    """The data set, once PyBIDS has answered all that it can be asked about its entities."""
    from bids.layout import BIDSLayout

    layout = BIDSLayout(folder)
    assert repr(layout)
    for name in entities():
        for found in (layout.get(return_type="id", target=name), getattr(layout, f"get_{name}s")()):
            assert all(isinstance(value, str | int) for value in found), name
    assert not layout.to_df(metadata=True).empty
    return layout


def asking(*names: str) -> Dataset:
    """One session of a study with questions of these names."""
    asked = 'kind = "text"\nwhen = "before"\ntext = { en = "A?", zh = "A?" }\n'
    questions = "".join(f'[[question]]\nname = "{name}"\n{asked}' for name in names)
    session = Written("P01", text=study_text() + questions)
    session.whole({})
    return dataset([session.events], session.study, "0", rehearsals=False)


@pytest.mark.parametrize(
    ("data", "sessions"),
    [
        (lambda: nasty(rehearsals=True), ["1", "2"]),
        (lambda: published("1", "a-b"), []),
        (lambda: asking("runs", "runs_answer", *sorted(set(entities()) - TAKEN)), []),
        (lambda: exported([session("P01", 1, 30)], ONCE.replace('"voltage"', '"subject"')), []),
        (lambda: exported([session("P01", 1, 30)], ONCE.replace('"voltage"', '"=1+1"')), []),
    ],
    ids=["two sessions", "published", "questions as entities", "factor subject", "factor =1+1"],
)
def test_pybids_reads_the_export(
    data: Callable[[], Dataset], sessions: list[str], tmp_path: Path
) -> None:
    made = data()
    layout = as_pybids_reads(written(bids(made), tmp_path / "bids"))
    assert sorted(layout.get_sessions()) == sessions
    assert len(layout.get_subjects()) == len(made.participants)
    table = layout.get(suffix="beh", extension=".tsv")[0]
    columns = table.get_df().columns
    assert len(columns) == len(set(columns)) == len(made.shared_columns)
    assert set(columns) <= table.get_metadata().keys()


def test_the_validator_would_find_an_error(tmp_path: Path) -> None:
    files = bids(nasty())
    table = next(path for path in files if path.endswith("_beh.tsv"))
    broken = {**files, table: files[table].replace("\ttrial\t", "\tfrob\t"), "stray.txt": "x"}
    found = complaints(written(broken, tmp_path / "bids"))
    codes = {entry["code"] for entry in found if entry["severity"] == "error"}
    assert codes == {"TSV_VALUE_INCORRECT_TYPE", "NOT_INCLUDED"}


@pytest.mark.parametrize("kind", ["nasty", "rehearsals", "published"])
def test_nothing_slips_past_the_validators(kind: str) -> None:
    data = published("1", "a-b") if kind == "published" else nasty(rehearsals=kind == "rehearsals")
    assert list(bids_slips(bids(data))) == []
    assert list(psychds_slips(psychds(data))) == []
    assert list(text_slips(csv(data))) == []


def spoilt_everywhere(files: dict[str, str], good: str, bad: str) -> dict[str, str]:
    return {path: text.replace(good, bad) for path, text in files.items()}


Spoilt = Callable[[dict[str, str], str], Mapping[str, str]]


@pytest.mark.parametrize(
    ("spoil", "slip"),
    [
        (lambda files, at: {**files, at: files[at].replace("\n", "\r\n")}, "CR"),
        (lambda files, at: {**files, at: "\ufeff" + files[at]}, "BOM"),
        (lambda files, at: {**files, at: files[at].replace("\t", ",")}, "no tabs"),
        (lambda files, at: {**files, at: files[at].replace("n/a", "", 1)}, "an empty cell"),
        (lambda files, at: {k: v for k, v in files.items() if k != at}, "no data"),
        (lambda files, at: {**files, "notes.txt": "x\n"}, "stray"),
        (
            lambda files, at: spoilt_everywhere(files, '"TaskName": "t', '"TaskName": "x'),
            "the task is called",
        ),
    ],
)
def test_a_slip_would_be_seen(spoil: Spoilt, slip: str) -> None:
    files = bids(nasty())
    table = next(path for path in files if path.endswith("_beh.tsv"))
    assert any(slip in found for found in bids_slips(spoil(files, table)))


@pytest.mark.parametrize(
    ("spoil", "slip"),
    [
        (lambda files, at: {**files, at.replace("_task-", "_frob-"): files[at]}, "no keyword"),
        (lambda files, at: {**files, at.replace("_data.csv", ".csv"): files[at]}, "rule for names"),
        (lambda files, at: {**files, at: files[at].replace("score,", "frob,", 1)}, "differ"),
        (lambda files, at: {**files, at: files[at] + "a,b\n"}, "ragged"),
        (
            lambda files, at: {
                k: v.replace('"@type": "Dataset"', '"@type": "X"') for k, v in files.items()
            },
            "no schema.org Dataset",
        ),
    ],
)
def test_a_breach_of_psychds_would_be_seen(spoil: Spoilt, slip: str) -> None:
    files = psychds(nasty())
    table = next(path for path in files if path.endswith("_data.csv"))
    assert any(slip in found for found in psychds_slips(spoil(files, table)))


def test_the_scores_come_back_from_the_table() -> None:
    chains = [session.events for session in sessions(study_text())]
    told = load_study_data(chains, rehearsals=False)
    rows = [
        row
        for row in csv_rows(csv(nasty())["trials.csv"])
        if row["trial_kind"] == "trial" and row["excluded"] == "no" and row["score"]
    ]
    written = [f"'{name}" if name.startswith("=") else name for name in told.table.conditions]
    for who, scores in zip(told.table.subjects, told.table.scores, strict=True):
        read = [
            [float(r["score"]) for r in rows if (r["participant"], r["condition"]) == (who, name)]
            for name in written
        ]
        means = [fmean(given) if given else np.nan for given in read]
        assert np.array_equal(means, scores, equal_nan=True), who


@pytest.mark.parametrize("name", EXPORTS)
def test_the_same_events_give_the_same_bytes(name: str) -> None:
    assert EXPORTS[name](nasty.__wrapped__()) == EXPORTS[name](nasty.__wrapped__())


@pytest.mark.parametrize("name", EXPORTS)
def test_nobody_who_withdrew_is_anywhere(name: str) -> None:
    assert not any("W01" in path + text for path, text in EXPORTS[name](nasty()).items())


def test_rehearsals_come_only_when_asked_for_and_are_marked() -> None:
    without, asked = bids(nasty()), bids(nasty(rehearsals=True))
    assert not any("R01" in path for path in without)
    assert "**Rehearsals.**" not in without["README.md"]
    (table,) = [
        text for path, text in asked.items() if "sub-R01" in path and path.endswith("_beh.tsv")
    ]
    assert {row["session_kind"] for row in tsv_rows(table)} == {"rehearsal"}
    assert 0 < asked["README.md"].index("**Rehearsals.**") < 100


@pytest.mark.parametrize("export", [bids, psychds])
def test_a_readme_shown_as_a_page_runs_nothing(
    export: Callable[[Dataset], dict[str, str]],
) -> None:
    page = export(nasty())["README.md"]
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert "<" not in page


def test_each_touch_has_a_row_with_what_its_trial_lists() -> None:
    files = csv(nasty())
    touches = csv_rows(files["touches.csv"])
    key = ("participant", "session", "session_kind", "trial_index")
    own = {name for name in touches[0] if name not in {*key, "touch"}}
    assert own == {column.name for column in COLUMNS if column.per_touch}
    assert json.loads(files["touches.json"]).keys() == touches[0].keys()
    assert "one_per_touch_separated_by" not in files["touches.json"]
    for trial in csv_rows(files["trials.csv"]):
        mine = [row for row in touches if all(row[name] == trial[name] for name in key)]
        assert [row["touch"] for row in mine] == [str(n) for n in range(int(trial["touches"]))]
        beams = ";".join(row["beam"].replace(";", r"\;") or "n/a" for row in mine)
        assert beams == trial["beam"] or set(beams) <= set("n/a;")
        volts = ";".join(row["planned_voltage_v"] for row in mine)
        assert volts == trial["planned_voltage_v"]
    assert "touches.csv" not in csv(published("1"))


def test_participants_keep_their_pseudonyms_beside_labels_that_never_collide() -> None:
    people = tsv_rows(bids(nasty())["participants.tsv"])
    assert {row["pseudonym"]: row["participant_id"] for row in people} == {
        "P-01": "sub-P01x2",
        "P01": "sub-P01",
        "p_01": "sub-p01x3",
        "D01": "sub-D01",
        "E01": "sub-E01",
    }
    assert {row["session_count"] for row in people if row["pseudonym"] == "P01"} == {"2"}


def test_the_group_stands_with_participants_and_trials_in_every_format(tmp_path: Path) -> None:
    group: dict[str, str] = {}
    chains = []
    for first, *others in (each.events for each in sessions(study_text())):
        who = str(first.payload.get("participant"))
        own = group.setdefault(who, "young" if len(group) % 2 else "=old")
        chains.append([replace(first, payload={**first.payload, "group": own}), *others])
    data = dataset(chains, parsed_study(study_text()), "0", rehearsals=False)
    files = bids(data)
    people = tsv_rows(files["participants.tsv"])
    assert {row["group"] for row in people} == {"'=old", "young"}
    assert json.loads(files["participants.json"])["group"]["Description"]
    of_label = {row["participant_id"]: row["group"] for row in people}
    for name, text in files.items():
        if name.endswith("_beh.tsv"):
            label = name.partition("/")[0]
            assert {row["group"] for row in tsv_rows(text)} == {of_label[label]}
    tables = [text for name, text in psychds(data).items() if name.endswith("_data.csv")]
    assert all("group" in csv_rows(text)[0] for text in tables)
    assert [*bids_slips(files), *psychds_slips(psychds(data))] == []
    assert warnings(written(files, tmp_path)) == NOBODY_SAID
    assert "group" not in bids(nasty())["participants.json"]


def test_sessions_are_named_only_where_there_are_several() -> None:
    assert "sub-P01/ses-2/beh/sub-P01_ses-2_task-touch1_beh.tsv" in bids(nasty())
    assert "data/subject-P01_session-2_task-touch1_data.csv" in psychds(nasty())
    assert "sub-1/beh/sub-1_task-touch1_beh.tsv" in bids(published("1"))
    assert "data/subject-1_task-touch1_data.csv" in psychds(published("1"))


def test_a_study_without_latin_letters_has_a_task_all_the_same() -> None:
    text = study_text().replace(r"touch \"触觉\" 🖐 1", "触觉")
    session = Written("P01", text=text)
    session.whole({})
    files = bids(dataset([session.events], parsed_study(text), "0", rehearsals=False))
    assert "sub-P01/beh/sub-P01_task-touch_beh.tsv" in files
    assert list(bids_slips(files)) == []


def test_every_column_is_described_with_unit_and_levels() -> None:
    sidecars = [json.loads(text) for path, text in bids(nasty()).items() if "_beh.json" in path]
    for sidecar in sidecars:
        other = {"session": "session_number", "direction": "touch_direction"}
        shared = [other.get(it.name, it.name) for it in COLUMNS if not it.private]
        assert [name for name in sidecar if name in shared] == shared
        assert all(len(sidecar[name]["Description"]) > 10 for name in shared)
        assert sidecar["duration_s"]["Units"] == "s"
        assert "Unit: Hz." in sidecar["commanded_frequency_hz"]["Description"]
        assert {f"'{NAMES['frequency']}", "pressure"} <= sidecar["condition"]["Levels"].keys()


def test_trials_are_events_in_the_order_of_time() -> None:
    files = bids(nasty())
    stem = "sub-P01/ses-2/beh/sub-P01_ses-2_task-touch1"
    events, trials = (tsv_rows(files[f"{stem}_{suffix}.tsv"]) for suffix in ("events", "beh"))
    assert events[0]["onset"] == "0.0"
    assert [float(event["onset"]) for event in events] == [
        float(trial["started_monotonic_s"]) - float(trials[0]["started_monotonic_s"])
        for trial in trials
    ]
    for theirs, ours in {
        "duration": "duration_s",
        "trial_type": "trial_kind",
        "response_time": "reaction_time_s",
        "trial_index": "trial_index",
    }.items():
        assert [event[theirs] for event in events] == [trial[ours] for trial in trials]
    tagged = json.loads(files[f"{stem}_events.json"])["trial_type"]
    assert tagged["HED"].keys() == tagged["Levels"].keys() >= {row["trial_kind"] for row in trials}


def test_the_validator_judges_the_tags_of_events(tmp_path: Path) -> None:
    files = bids(nasty())
    told = {name: text.replace("Sensory-event", "Sensory-evnt") for name, text in files.items()}
    assert {
        it["code"] for it in complaints(written(told, tmp_path)) if it["severity"] == "error"
    } == {"HED_ERROR"}


def test_published_scores_are_no_events() -> None:
    assert not [path for path in bids(published("1")) if "_events" in path]


def test_a_missing_score_is_missing_and_a_zero_is_zero() -> None:
    files = bids(nasty())
    path = next(path for path in files if "p01x3" in path and path.endswith("_beh.tsv"))
    assert {row["score"] for row in tsv_rows(files[path])} == {"n/a"}
    path = next(path for path in files if "P01x2" in path and path.endswith("_beh.tsv"))
    assert {"0", "10", "7"} <= {row["score"] for row in tsv_rows(files[path])}


def test_facts_of_the_author_stand_where_the_study_file_gives_them() -> None:
    described = json.loads(bids(nasty())["dataset_description.json"])
    assert described["Name"] == 'Touch, "felt" 触觉'
    assert described["Authors"] == ["Surname, Given", "姓名"]
    assert described["DatasetDOI"] == "doi:10.5072/example"
    described = json.loads(psychds(nasty())["dataset_description.json"])
    assert described["author"][1] == {"@type": "Person", "name": "姓名"}
    assert described["sourceOrganization"]["address"] == "A street"
    assert "- Committee 1\n" in bids(nasty())["README.md"]


@pytest.mark.parametrize("export", [bids, psychds])
def test_nothing_is_invented_where_it_does_not(export: Callable[[Dataset], dict[str, str]]) -> None:
    described = json.loads(export(nasty(publication=False))["dataset_description.json"])
    facts = re.compile("author|licen[sc]e|fund|ethics|citation|references|doi|institution", re.I)
    assert [key for key in described if facts.search(key)] == []
    assert described.get("Name", described.get("name")) == 'touch "触觉" 🖐 1'


def test_the_words_of_the_operator_arrive() -> None:
    rows = csv_rows(csv(nasty())["trials.csv"])
    by_index = {row["trial_index"]: row for row in rows if row["participant"] == "P-01"}
    assert by_index["0"]["notes"] == 'said "no",\tthen\nleft\n<script>alert(1)</script>'
    assert by_index["1"]["notes"].startswith("'=cmd()")
    assert by_index["4"]["notes"] == r"bell \x07, escape \x1b[31m, line \u2028 separator"
    assert by_index["0"]["room_temperature"] == "'=20+1"
    assert by_index["0"]["beam"] == r"1\;5 mm"


@pytest.mark.parametrize("export", [bids, psychds])
def test_notes_and_the_time_of_day_stay_out_of_what_is_shared(
    export: Callable[[Dataset], dict[str, str]],
) -> None:
    text = "".join(export(nasty()).values())
    assert not re.search(r"started_utc|answered_utc|2026-01-01|\bleft\\?n|cmd\(\)\|' /C", text)


def test_a_published_table_says_what_it_knows_and_no_more() -> None:
    rows = csv_rows(csv(published("1"))["trials.csv"])
    known = [{name: value for name, value in row.items() if value} for row in rows]
    assert known[0] == {
        "participant": "1",
        "session": "1",
        "session_kind": "published",
        "session_completed": "true",
        "trial_kind": "published",
        "condition": "voltage",
        "score": "9.0",
        "excluded": "no",
        "response": "9.0",
    }
    assert not {"score", "response"} & known[1].keys()


def test_nobody_is_said_to_have_touched_anything_for_a_published_table() -> None:
    data = published("1")
    files = bids(data)
    page, sidecar = files["README.md"], files["sub-1/beh/sub-1_task-touch1_beh.json"]
    described = json.loads(psychds(data)["dataset_description.json"])["description"]
    for text in (page, json.loads(sidecar)["TaskDescription"], described):
        assert "imported from scores.csv (SHA-256 0)" in text
        assert "the participant touches" not in text
    assert "A row is a score of a subject under a condition" in page
    assert "_events" not in page
    assert "Published" not in page + sidecar + described
    assert set(data.condition_levels().values()) == {"a condition of the imported table"}


def test_published_scores_among_sessions_are_named_as_such() -> None:
    played = Written("P01")
    played.whole({})
    chains = [played.events, published_chain("1", {"voltage": 9.0})]
    data = dataset(chains, played.study, "0", rehearsals=False)
    assert "the participant touches" in data.description()
    assert "`published` are imported from scores.csv (SHA-256 0)" in data.description()


def test_an_erased_session_is_passed_over() -> None:
    kept = Written("P01")
    kept.whole({})
    erased = [
        StoredEvent(
            seq=e.seq, tag=e.tag, utc=e.utc, monotonic_s=e.monotonic_s, payload={}, erased=True
        )
        for session in sessions(study_text())
        if session.participant == "W01"
        for e in session.events
    ]
    data = dataset([erased, kept.events], kept.study, "0", rehearsals=False)
    assert (data.sessions["participant"].tolist(), data.tables.found.withdrawn) == (["P01"], 1)


def test_one_of_a_kind_is_counted_as_one() -> None:
    page = bids(published("1"))["README.md"]
    assert "- 1 participant, 1 session, 2 trials\n" in page
    assert not re.search(r"\b1 (participants|sessions|trials|rehearsals)\b", page)
