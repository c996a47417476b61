"""Columns of tracks in exports and in tables for Python, only where a study has tracks."""

import csv
import io
import json
from collections import Counter

from analysis.export.bids import bids_export
from analysis.export.csv_tables import csv_tables
from analysis.export.dataset import dataset
from analysis.export.trial_table import Frames
from analysis.felt.measured_statistics import with_measures
from analysis.loading.sessions import load_sessions
from protocol.study_file.loading import parsed_study, template
from protocol.tracks.procedure import Answer, place_after
from tests.analysis.chains import chain, scored_session
from tests.analysis.tracks import BOTH, TRACKS, session

NEW = ["track", "track_role", "level_value", "interval", "correct", "reversal"]
STAIRCASE = "by a staircase"


def tables(text: str) -> dict[str, str]:
    return csv_tables(dataset([session(text, "P01")], parsed_study(text), "0", rehearsals=False))


def test_trials_of_tracks_have_their_level_and_what_became_of_it() -> None:
    study, made = parsed_study(BOTH), tables(BOTH)
    rows = list(csv.DictReader(io.StringIO(made["trials.csv"])))
    assert list(rows[0])[-len(NEW) - 1 :] == [*NEW, "response"]
    # A trial of a track counts for no condition, any other here has an answer.
    assert all((row["response"] == "") == (row["track"] != "") for row in rows)
    assert {(row["trial_kind"], row["track"] != "") for row in rows} == {
        ("trial", False),
        ("track", True),
    }
    own = [row for row in rows if row["track"] == STAIRCASE]
    track = study.track_of(STAIRCASE)
    assert all(float(row["level_value"]) == track.values[int(float(row["level"]))] for row in own)
    assert all((row["expected"] == row["change"]) == (row["correct"] == "true") for row in own)
    # The rule itself says where it turned.
    told = [Answer(int(float(row["level"])), row["correct"] == "true") for row in own]
    turned = [told[at].level for at, row in enumerate(own) if row["reversal"] == "true"]
    assert tuple(turned) == place_after(track, told).turned_at
    assert len(turned) == 12
    quest = [row for row in rows if row["track"] == "smallest amplitude"]
    assert {row["reversal"] for row in quest} == {""}
    catch = [row for row in quest if not row["level"]]
    assert [[row[name] for name in ("level_value", "interval", "correct")] for row in catch] == [
        ["", "", ""]
    ] * 4
    assert Counter(row["track_role"] for row in quest) == {"level": 40, "catch": 4, "easy": 4}
    easiest = len(study.track_of("smallest amplitude").values) - 1
    assert {row["level"] for row in quest if row["track_role"] == "easy"} == {f"{easiest}.0"}
    told_of = json.loads(made["trials.json"])
    assert told_of["track"]["levels"][STAIRCASE] == "two intervals, staircase; levels of voltage, V"
    assert "the number of its level" in told_of["level"]["description"]


def test_events_of_a_data_set_have_the_levels_too() -> None:
    data = dataset([session(TRACKS, "P01")], parsed_study(TRACKS), "0", rehearsals=False)
    files = sorted(bids_export(data).items())
    sidecar, table = (text for path, text in files if "_events." in path)
    names = ["track", "track_role", "level", "level_value", "interval", "correct", "reversal"]
    assert table.splitlines()[0].split("\t")[5:] == names
    told = json.loads(sidecar)
    assert set(names) < set(told)
    assert "track" in told["trial_type"]["Levels"]
    assert "track" in told["trial_type"]["HED"]
    assert "a parameter changes ()" not in told["TaskDescription"]


def test_tables_for_python_have_the_same_columns() -> None:
    found = with_measures(parsed_study(BOTH), load_sessions([session(BOTH, "P01")]))
    frames = Frames(found=found, kept=found.sessions, questions=(), lowest=0.0)
    assert list(frames.trials.columns[-len(NEW) - 1 :]) == [*NEW, "response"]
    assert frames.trials["reversal"].sum() == 12
    described = frames.described("0 to 10")
    assert described.loc[("trials", "correct"), "levels"] == "true: yes; false: no"


def test_a_touch_that_slides_at_a_speed_of_its_own_says_so() -> None:
    slow, usual = 'place = "path", voltage_v = 0, sliding_speed_m_s = 0.02', 'place = "path"'
    text = TRACKS.replace('place = "smooth", voltage_v = 0', slow).replace(
        'place = "smooth"', usual
    )
    made = tables(text)
    rows = csv.DictReader(io.StringIO(made["touches.csv"]))
    speeds = Counter(row["sliding_speed_m_s"] for row in rows)
    trials = list(csv.DictReader(io.StringIO(made["trials.csv"])))
    # A comparison slides as usual; in a catch trial every touch is the standard.
    compared = sum(row["level"] != "" for row in trials)
    assert speeds == {"": compared, "0.02": 2 * len(trials) - compared}
    assert json.loads(made["trials.json"])["sliding_speed_m_s"]["unit"] == "m/s"


def test_a_study_without_tracks_has_none_of_them() -> None:
    paper = parsed_study(template("paper"))
    told = [(name, 5) for name in paper.conditions]
    chains = [chain(scored_session("P01", told, paper.conditions))]
    made = csv_tables(dataset(chains, paper, "0", rehearsals=False))
    assert not {*NEW} & {*made["trials.csv"].splitlines()[0].split(",")}
    assert "track" not in made["trials.json"]
