"""Columns of factors, and answers that are given once."""

from collections.abc import Sequence

from analysis.export.bids import bids_export
from analysis.export.csv_tables import csv_tables
from analysis.export.dataset import Dataset, dataset
from analysis.export.psychds import psychds_export
from analysis.loading.records import values
from protocol.journal.events import Event, QuestionAnswered, StoredEvent
from protocol.study.columns import factor_columns
from protocol.study_file.loading import parsed_study
from tests.analysis.chains import chain, scored_session
from tests.protocol.study.test_factor import RAMPS

AGE = """
[session]
languages = ["en"]
[[question]]
name = "age"
kind = "number"
when = "before"
sessions = "SESSIONS"
minimum = 18
maximum = 99
text.en = "Your age?"
"""
ONCE = RAMPS.replace('name = "frequency"\n', 'name = "seed"\n') + AGE
STUDY = parsed_study(ONCE.replace("SESSIONS", "first"))


def session(who: str, number: int, *ages: int) -> list[StoredEvent]:
    """A session of two conditions; each of `ages` is an answer."""
    told = [(name, 5) for name in STUDY.conditions[:2]]
    first, *others = scored_session(who, told, STUDY.conditions, session=number)
    given: list[Event] = [
        QuestionAnswered(
            name="age", answer=age, reaction_time_s=1.0, when="before", block=None, trace=None
        )
        for age in ages
    ]
    return chain([first, *given, *others])


def exported(chains: Sequence[Sequence[StoredEvent]], text: str = ONCE) -> Dataset:
    return dataset(chains, parsed_study(text.replace("SESSIONS", "first")), "0", rehearsals=False)


def test_each_factor_is_a_column_by_its_name_or_one_that_is_free() -> None:
    data = exported([session("P01", 1, 30)])
    assert values(data.trials["voltage"]) == ["50 V", "50 V"]
    # There is a column `seed` already, of the session's seed.
    assert values(data.trials["factor_seed"]) == ["23 kHz", "24 kHz"]
    assert values(data.trials["seed"]) == [1, 1]
    tables = csv_tables(data)
    assert '"100 V": "100"' in tables["trials.json"]
    named = "voltage,voltage_value,factor_seed,factor_seed_value,age,"
    assert named in tables["trials.csv"].partition("\n")[0]
    files = bids_export(data)
    (told,) = (text for path, text in files.items() if path.endswith("_beh.tsv"))
    assert "\tvoltage\tvoltage_value\tfactor_seed\tfactor_seed_value\t" in told
    frames = data.tables
    assert values(frames.trials["voltage"]) == ["50 V", "50 V"]
    assert frames.described("0 to 10").loc[("trials", "voltage"), "meaning"] == (
        "Factor of the condition, which sets ramp_to_v of a touch."
    )


def test_levels_stand_in_the_order_of_the_study_and_with_their_numbers() -> None:
    """Not in the order of the alphabet, in which 100 V comes before 50 V."""
    trials = exported([session("P01", 1, 30)]).tables.trials
    assert trials["voltage"].cat.ordered
    levels = ["50 V", "100 V", "150 V", "200 V"]
    assert trials["voltage"].cat.categories.tolist() == levels
    assert trials["voltage_value"].tolist() == [50.0, 50.0]
    assert trials["factor_seed_value"].tolist() == [23_000.0, 24_000.0]
    described = exported([session("P01", 1, 30)]).tables.described("0 to 10")
    assert described.loc[("trials", "voltage_value"), "unit"] == "V"
    assert described.loc[("trials", "voltage_value"), "meaning"] == (
        "What voltage sets ramp_to_v of a touch to."
    )
    assert described.loc[("trials", "factor_seed_value"), "unit"] == "Hz"


def test_a_factor_of_words_has_no_numbers() -> None:
    words = RAMPS.replace("frequency_hz", "direction").replace(
        "[23000, 24000, 25000]", '["left", "right"]'
    )
    columns = factor_columns(parsed_study(words), ())
    assert [column.name for column in columns] == ["voltage", "voltage_value", "frequency"]


def test_a_heading_is_no_formula_in_a_table_nor_in_what_describes_it() -> None:
    data = exported([session("P01", 1, 30)], ONCE.replace('"voltage"', '"=1+1"'))
    tables, bids, psychds = csv_tables(data), bids_export(data), psychds_export(data)
    assert ",'=1+1," in tables["trials.csv"].partition("\n")[0]
    assert '"\'=1+1": {' in tables["trials.json"]
    for end, mark in (("_beh.tsv", "\t'=1+1\t"), ("_beh.json", '"\'=1+1": {')):
        assert all(mark in text for path, text in bids.items() if path.endswith(end))
    assert '"name": "\'=1+1"' in psychds["dataset_description.json"]
    # Programs have the name as it is.
    assert "=1+1" in data.trials


def test_an_answer_given_once_stands_with_all_trials_of_the_participant_alone() -> None:
    chains = [session("P01", 1, 30), session("P02", 1, 41), session("P01", 2), session("P03", 1)]
    trials = exported(chains).trials
    ages = {name: values(own["age"]) for name, own in trials.groupby(["participant", "session"])}
    assert ages == {
        ("P01", 1): [30, 30],
        ("P01", 2): [30, 30],
        ("P02", 1): [41, 41],
        ("P03", 1): [None, None],
    }
    every = ONCE.replace('"SESSIONS"', '"every"')
    assert values(exported(chains, every).trials["age"]) == [30, 30, 41, 41] + 4 * [None]


def test_the_last_answer_of_the_first_session_counts_and_a_later_sessions_own_before_it() -> None:
    chains = [session("P01", 1, 30, 31), session("P01", 2, 32), session("P01", 3)]
    assert values(exported(chains).trials["age"]) == [31, 31, 32, 32, 31, 31]
