"""Tables of answers: published data, rows per level and per trial, messages."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import touchbeam
from analysis.tables.reading import cells_in
from analysis.tables.table_cells import TableError
from analysis.thresholds.answer_table import (
    Track,
    columns_line,
    left_out_line,
    pooled_line,
    tracks_in,
)

DATA = Path(__file__).parents[2] / "data" / "vibration_speed.csv"
"""Answers of nine people, of data set vibro_exp3 of the R package MixedPsy: is the surface faster
than 8.5 cm/s? Dallmann, Ernst and Moscatelli, Journal of Neurophysiology 114, 2015."""
HEADER = "participant,track,level,trials,correct\n"


def read(
    text: str, source: str, shape: str, columns: str | None = None, answers: str | None = None
) -> list[Track]:
    return tracks_in(cells_in(text.encode(), source, most=1000), shape, columns, answers)


def means(found: pd.DataFrame) -> list[float]:
    """Midpoint and JND with vibration, then without."""
    by_track = found.groupby("track")[["threshold", "jnd"]].mean()
    return [float(value) for value in by_track.to_numpy().ravel()]


def test_speed_with_and_without_vibration() -> None:
    """The means are those of probit regressions, which know no lapses and no false alarms."""
    answers = pd.read_csv(DATA)
    found = touchbeam.fit(answers, task="yes or no", shape="normal", lapse=0.0)
    assert means(found) == pytest.approx([8.41, 3.62, 8.57, 2.93], abs=0.03)


def test_lapses_and_false_alarms_make_the_difference_limen_smaller() -> None:
    """The most probable curves of psignifit 4.3 have 8.675, 3.354, 8.215 and 2.487; medians, over
    all rates of lapses and false alarms that the answers leave open, go farther (regression)."""
    found = touchbeam.fit(pd.read_csv(DATA), task="yes or no", shape="normal")
    assert means(found) == pytest.approx([8.71, 2.62, 8.27, 2.08], abs=0.02)


def test_a_row_per_trial_and_other_columns() -> None:
    text = (
        "Correct,note,track,level,participant\n1,a,T,2.5,P01\nfalse,,T,1,P01\n\n0,,U,1e1,P01\n"
        "True,,T,1,P01\n"
    )
    assert read(text, "answers.csv", "weibull") == [
        Track("P01", "T", [2.5, 1.0, 1.0], [1, 1, 1], [1, 0, 1]),
        Track("P01", "U", [10.0], [1], [0]),
    ]


@pytest.mark.parametrize(
    ("header", "columns", "said"),
    [
        ("participant,track,level,trials,correct", None, ""),
        (
            "Versuchsperson,Bedingung,Spannung (V),N,richtig",
            None,
            "Columns: Versuchsperson is participant, Spannung (V) is level, Bedingung is track, "
            "richtig is correct, N is trials.",
        ),
        (
            "姓名,Material,voltage_v,trials,Response",
            None,
            "Columns: 姓名 is participant, voltage_v is level, Material is track, "
            "Response is correct.",
        ),
        (
            "受试者,stim,amplitude,trials,hits",
            None,
            "Columns: 受试者 is participant, amplitude is level, stim is track, hits is correct.",
        ),
        (
            "Subject ID,surface,Stimulus,trials,yes",
            None,
            "Columns: Subject ID is participant, Stimulus is level, surface is track, "
            "yes is correct.",
        ),
        (
            "who,place,dose,runs,felt",
            "subject=WHO, condition=place,level=#3,trials=runs,answer=felt",
            "Columns: who is participant, place is track, dose is level, runs is trials, "
            "felt is correct.",
        ),
    ],
)
def test_columns_by_other_names(header: str, columns: str | None, said: str) -> None:
    text = f"{header}\nP01,T,2.5,20,12\nP01,T,5,20,19\n"
    assert read(text, "answers.csv", "weibull", columns) == [
        Track("P01", "T", [2.5, 5.0], [20, 20], [12, 19])
    ]
    assert columns_line(cells_in(text.encode(), "answers.csv", most=9), columns) == said


def test_all_answers_may_be_those_of_one() -> None:
    (track,) = read("level,yes\n1,0\n2,1\n", "answers.csv", "weibull", "subject=one")
    assert (track.participant, track.track) == ("1", "track")
    table = pd.DataFrame({"who": "P1", "volts": [1.0, 2, 4], "trials": 20, "correct": [9, 15, 20]})
    found = touchbeam.fit(table, columns="subject=who,level=volts")
    own = touchbeam.fit(table.rename(columns={"who": "participant", "volts": "level"}))
    assert found.equals(own)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            "subject",
            "^--columns must be pairs such as subject=ID,condition=material, of subject",
        ),
        ("score=level", "of subject, condition, level, trials, answer, ignore, got 'score=level'$"),
        ("level=volts", "--columns: no column 'volts'; there are participant, track, level, trial"),
        ("level=level,level=trials", "--columns: level=trials is said twice"),
        ("ignore=level", "must have the column level, got participant, track, level, trials, corr"),
    ],
)
def test_wrong_roles(columns: str, message: str) -> None:
    with pytest.raises(TableError, match=message):
        read(f"{HEADER}P,T,1,2,1\n", "answers.csv", "weibull", columns)


RECORDED = "participant,track,level,level_value,correct,excluded\n"


def test_rows_that_are_left_out_are_counted_by_reason() -> None:
    trials = (
        f"{RECORDED}P01,T,0,1,True,no\nP01,T,,,,no\nP01,T,,,False,session\nP01,T,1,2,,no\n"
        "P01,T,1,2,,session\nP01,T,1,2,False,session\nP02,T,0,1,True,no\nP02,T,1,2,NA,no\n"
    )
    said = left_out_line(read(trials, "trials.csv", "weibull"))
    assert said == "6 rows were left out: 3 without an answer, 2 catch trials, 1 excluded."
    one = read(f"{RECORDED}P,T,0,1,True,no\nP,T,,,,no\n", "trials.csv", "weibull")
    assert left_out_line(one) == "1 row was left out: 1 catch trial."
    roles = "participant,track,track_role,level_value,correct,excluded\nP,T,level,1,True,no\n"
    ended = read(f"{roles}P,T,catch,,,no\nP,T,level,,,no\n", "trials.csv", "weibull")
    assert left_out_line(ended) == "2 rows were left out: 1 without an answer, 1 catch trial."
    by_hand = f"{HEADER}P,T,1,2,1\n" + "P,T,2,2,\n" * 11
    said = left_out_line(read(by_hand, "answers.csv", "weibull"))
    assert said == "11 rows were left out: 11 without an answer."
    assert left_out_line(read(f"{HEADER}P,T,1,2,1\n", "answers.csv", "weibull")) == ""


def test_of_recorded_trials_the_level_is_its_value_and_not_its_number() -> None:
    text = (
        f"{RECORDED}P01,T,0,1,True,no\nP01,T,3,8,True,no\nP01,,1,,,no\nP01,T,,,,no\n"
        "P01,T,1,2,,no\nP01,T,1,2,False,session\nP01,T,1,2,False,no\nP02,T,,,,no\n"
    )
    assert read(text, "trials.csv", "weibull") == [
        Track(
            "P01",
            "T",
            [1.0, 8.0, 2.0],
            [1, 1, 1],
            [1, 1, 0],
            Counter({"catch trials": 1, "without an answer": 1, "excluded": 1}),
        )
    ]


def test_of_recorded_trials_a_track_may_be_called_as_what_is_missing() -> None:
    (track,) = read(f"{RECORDED}P01,none,0,1,True,no\n", "trials.csv", "weibull")
    assert track.track == "none"


def test_the_threshold_of_recorded_trials_is_in_the_unit_of_the_levels() -> None:
    values, right = [1.0, 2.0, 4.0, 8.0], [10, 13, 18, 20]
    rows = [
        (number, value, trial < correct)
        for number, (value, correct) in enumerate(zip(values, right, strict=True))
        for trial in range(20)
    ]
    table = pd.DataFrame(rows, columns=["level", "level_value", "correct"])
    found = touchbeam.fit(table.assign(participant="P01", track="T"))
    by_hand = pd.DataFrame({"level": values, "trials": 20, "correct": right})
    known = touchbeam.fit(by_hand.assign(participant="P01", track="T"))
    assert found.threshold.item() == known.threshold.item()
    assert found.threshold.item() == pytest.approx(2.67, abs=0.02)  # 1.4 by their numbers


def test_a_name_that_looks_like_a_formula_is_a_name() -> None:
    (track,) = read(f"{HEADER}'=1+1,T,1,2,1\n", "answers.csv", "weibull")
    assert track.participant == "=1+1"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must have a header"),
        (HEADER, "must have a row of answers below the header, got none"),
        (
            "participant,track,level\nP,T,1\n",
            "line 1: must have the column correct, got participant, track, level; add --columns an",
        ),
        (
            "track,level,correct\nT,1,0\n",
            "must have the column participant, got .*; add --columns subject=NAME, or subject=one",
        ),
        (
            "subject,Volt,Reiz,correct\nP,1,2,1\n",
            "each of Volt, Reiz may be the level; add --columns level=NAME, and ignore=NAME for th",
        ),
        ("id,id,level,correct\nP,P,1,1\n", "line 1: the column id must stand once; rename the"),
        (f"{HEADER}P01,T,1,2,1\np01,T,1,2,1\n", "'p01' and 'P01' may be one or two; write"),
        (f"{HEADER}P01,T,1,2,1\nP01,t,1,2,1\n", "'t' and 'T' may be one or two; write"),
        (
            "participant,track,level,level,correct\n",
            "line 1: the column level must stand once; rename the others",
        ),
        (f"{HEADER}P,T,1,2\n", "line 2: must have 5 cells as the header, got 4"),
        (f"{HEADER}P,T,1,2,1\n,T,1,2,1\n", "line 3, column participant: must have a name, got non"),
        *(
            (
                f"{HEADER}P,T,1,2,1\n{who},{track},1,2,1\n",
                f"line 3, column {name}: must have a name, got '{got}'; write one in each row$",
            )
            for who, track, name, got in (
                ("NaN", "T", "participant", "NaN"),
                ("NA", "T", "participant", "NA"),
                ("-", "T", "participant", "-"),
                ("P", "n/a", "track", "n/a"),
            )
        ),
        (
            f"{HEADER}P,T,1 V,2,1\n",
            "line 2, column level: a level must be a number from -1e100 to 1e100, got '1",
        ),
        (
            f"{HEADER}P,T,inf,2,1\n",
            "line 2, column level: a level must be a number from -1e100 to 1e100, got 'i",
        ),
        (f"{HEADER}P,T,-1,2,1\n", "at least 0 for the shape weibull, .* got -1; use --shape norma"),
        (f"{HEADER}P,T,1,2,3\n", "line 2, column correct: must be at most the 2 trials, got 3"),
        (f"{HEADER}P,T,1,2.5,1\n", "column trials: must be a whole number from 0 to 10+, got '2.5"),
        (f"{HEADER}P,T,1,1e99,1\n", "column trials: must be a whole number from 0 to 10+, got '1e"),
        (f"{HEADER}P,T,1,2,=1\n", "line 2, column correct: is a formula, '=1'; save the table"),
        ("ID,volts,resp\nP,1,=A1+1\n", "line 2, column resp: is a formula, '=A1"),
        ("ID,volts,resp\nP,1,maybe\n", "line 2, column resp: must be 1 or 0 in a row per trial"),
        (f"{HEADER}P,T,1,2,x\n", "column correct: must be a whole number from 0 to 10+, got 'x'"),
        (
            "participant,track,level,correct\nP,T,1,7\n",
            "line 2, column correct: must be 1 or 0 in a row per trial, got '7'; add --columns tr",
        ),
        (
            f"{RECORDED}P,T,,,,no\n",
            "answers.csv: must have an answered trial at a level of a track, got none",
        ),
        (f"{RECORDED}P,T,1,x,1,no\n", "line 2, column level_value: a level must be a number from"),
        (f'{HEADER}"P,T,1,2,1\n', "line 2: a quotation mark is opened and never closed; close it"),
    ],
)
def test_wrong_tables(text: str, message: str) -> None:
    with pytest.raises(TableError, match=message) as error:
        read(text, "answers.csv", "weibull")
    assert str(error.value).startswith("answers.csv")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["n", "Total"])
@pytest.mark.parametrize(
    "rows",
    [
        ("P,T,1,1,1", "P,T,2,2,0", "P,U,1,1,1", "P,T,1,3,NA", "P,U,1,2,0", "Q,T,1,1,1"),
        ("P,T,1,1,yes", "P,U,2,2,no", "P,T,1,3,1.0", "Q,T,1,1,0", "Q,T,2,2,1"),
        ("P,T,1,1,1", "P,U,2,2,0", "Q,T,1,3,1", "Q,U,1,4,0"),
    ],
    ids=["in a track", "of a participant", "in the table"],
)
def test_a_column_that_may_number_the_trials_is_not_taken_for_their_count(
    name: str, rows: tuple[str, ...]
) -> None:
    text = "\n".join((f"participant,track,level,{name},correct", *rows))
    said = (
        f"^answers.csv, line 1: the column {name} may number the trials or count them: "
        f"add --columns trials={name}, or ignore={name}$"
    )
    with pytest.raises(TableError, match=said):
        read(text, "answers.csv", "weibull")
    (track, *_) = read(text, "answers.csv", "weibull", f"ignore={name}")
    assert set(track.trials) == {1}
    cells = cells_in(text.encode(), "answers.csv", most=1000)
    assert columns_line(cells, f"trials={name}") == f"Columns: {name} is trials."


@pytest.mark.parametrize(
    ("header", "rows"),
    [
        ("participant,track,level,trials,correct", ("P,T,1,1,1", "P,T,2,2,0")),
        ("participant,track,level,n,correct", ("P,T,1,1,1", "P,T,2,2,2")),
        ("participant,track,level,n,correct", ("P,T,1,1,1", "P,T,2,1,0")),
        ("participant,track,level,n,correct", ("P,T,1,1,1", "Q,T,2,1,0")),
        ("participant,track,level,n,correct", ("P,T,1,20,1", "P,T,2,21,0")),
    ],
    ids=["trials", "two of two", "a trial each", "a row each", "not from 1"],
)
def test_a_column_that_counts_the_trials_is_their_count(header: str, rows: tuple[str, ...]) -> None:
    tracks = read("\n".join((header, *rows)), "answers.csv", "weibull")
    counts = [int(row.split(",")[3]) for row in rows]
    assert [number for track in tracks for number in track.trials] == counts


def test_answers_that_cannot_be_fitted_say_whose_they_are() -> None:
    table = pd.DataFrame(
        {"participant": "P01", "track": "T", "level": [1.0, 2.0], "trials": 0, "correct": 0}
    )
    with pytest.raises(ValueError, match="answers, participant P01, track T: there must be at lea"):
        touchbeam.fit(table)


def test_one_level_alone_gives_no_threshold() -> None:
    table = pd.DataFrame({"participant": "P01", "track": "T", "level": [1.0], "correct": [1]})
    (record,) = touchbeam.fit(table).to_dict("records")
    assert np.isnan([record["threshold"], *record["threshold_ci"]]).all()
    assert record["flags"] == ("all answers at one level",)


def test_a_task_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^task must be one of yes or no, .*, got 'four'$"):
        touchbeam.fit(pd.read_csv(DATA), task="four")


def test_fractions_of_pandas_and_missing_answers_are_understood() -> None:
    answers = pd.Series([0.0, 1.0, 1.0, 1.0] * 4 + [0.0, None, 1.0, 1.0])
    table = pd.DataFrame({"participant": "P1", "track": "T", "level": [1.0, 2, 3, 4] * 5})
    found = touchbeam.fit(table.assign(correct=answers))
    whole = touchbeam.fit(table.assign(correct=answers).dropna().astype({"correct": int}))
    assert found.left_out.item() == 1
    assert found.threshold.item() == whole.threshold.item()


@pytest.mark.parametrize("answers", [{"level": [1]}, None, [1, 2], pd.Series([1])])
def test_what_is_no_frame_is_refused(answers: object) -> None:
    with pytest.raises(ValueError, match=r"^answers: must be a data frame of pandas, got "):
        touchbeam.fit(answers)  # type: ignore[arg-type]


def simulated(threshold: float, chance: float, rng: np.random.Generator) -> pd.DataFrame:
    levels = np.array([1.0, 1.5, 2, 3, 4, 6, 8])
    p = chance + (1 - chance) * (1 - np.exp(-np.log(2) * (levels / threshold) ** 3))
    return pd.DataFrame({"level": levels, "trials": 40, "correct": rng.binomial(40, p)})


def test_thresholds_of_many_alternatives_and_of_any_guess_rate_are_found() -> None:
    rng = np.random.default_rng(1)
    tables = [simulated(3, 0.25, rng).assign(participant=f"P{n}", track="T") for n in range(20)]
    asked: list[dict[str, Any]]
    asked = [{"task": "4AFC"}, {"guess": 0.25}, {"task": "2AFC", "guess": 0.25}]
    for known in asked:
        found = touchbeam.fit(pd.concat(tables), **known)
        assert found.threshold.mean() == pytest.approx(3, rel=0.05)
        assert (found.threshold_at == 0.625).all()
    free = touchbeam.fit(pd.concat(tables), guess="free")
    # Its prior, that of false alarms, draws it towards 0.
    assert 0.15 < free.guess.mean() < 0.25
    two = touchbeam.fit(tables[0], task="2AFC").drop(columns="participant")
    assert two.equals(touchbeam.fit(tables[0]).drop(columns="participant"))


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"task": "1AFC"}, "or 2AFC to 26AFC, got '1AFC'"),
        ({"task": "27AFC"}, "or 2AFC to 26AFC, got '27AFC'"),
        ({"guess": 0.95}, r"the guess rate must lie in \[0, 0.9\] or be free, got 0.95"),
        ({"guess": float("nan")}, "the guess rate must lie .* got nan"),
        ({"guess": 0.5, "threshold_at": 0.4}, "must lie above 0.5, which is chance"),
        (
            {"guess": 0.9, "lapse": 0.1},
            r"^guess rate plus lapse rate must be below 1, got 0.9 \+ 0.1: the curve would not ri",
        ),
        ({"guess": 0.8, "lapse": 0.3}, "must be below 1, got 0.8"),
    ],
)
def test_wrong_guess_rates(known: dict[str, object], message: str) -> None:
    table = pd.DataFrame({"participant": "P", "track": "T", "level": [1.0, 2], "correct": [0, 1]})
    with pytest.raises(ValueError, match=message):
        touchbeam.fit(table, **known)  # type: ignore[arg-type]


def test_lapses_leave_a_curve_above_a_high_guess_rate_that_does_not_fall() -> None:
    falling = pd.DataFrame({"level": [1.0, 2, 3, 4], "trials": 40, "correct": [40, 36, 30, 20]})
    found = touchbeam.fit(falling.assign(participant="P", track="T"), guess=0.9)
    assert 0 < found.lapse.item() < 0.1
    assert max(found.lapse_ci.item()) <= 0.1 + 1e-12


def test_the_interval_of_two_conditions_holds_the_ratio_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    tables = [
        simulated(threshold, 0.5, rng).assign(participant=f"P{n}", track=name)
        for n in range(100)
        for name, threshold in (("dry", 2.5), ("wet", 4.0))
    ]
    compared = touchbeam.fit(pd.concat(tables)).attrs["comparisons"]
    known = [each for each in compared if each["reason"] is None]
    held = sum(each["ci"][0] < 1.6 < each["ci"][1] for each in known)
    assert len(known) >= 95
    assert held >= 0.9 * len(known)
    assert np.median([each["value"] for each in known]) == pytest.approx(1.6, rel=0.05)


def test_a_condition_is_a_track_and_levels_as_given_are_compared_by_their_difference() -> None:
    rng = np.random.default_rng(3)
    tables = [
        simulated(threshold, 0.5, rng).assign(subject="P1", condition=name)
        for name, threshold in (("dry", 2.5), ("wet", 4.0))
    ]
    (ratio,) = touchbeam.fit(pd.concat(tables)).attrs["comparisons"]
    (difference,) = touchbeam.fit(pd.concat(tables), shape="normal").attrs["comparisons"]
    assert (ratio["a"], ratio["b"], ratio["of"]) == ("dry", "wet", "ratio")
    assert difference["of"] == "difference"
    assert difference["ci"][0] < difference["value"] < difference["ci"][1]
    one = touchbeam.fit(tables[0].iloc[:1].assign(correct=40)).attrs["comparisons"]
    assert one == []


TWO = "participant,condition,track,level,trials,correct\n" + "".join(
    f"{who},{place},{track},{level},20,{level * 9}\n"
    for who, place, track in (("A", "wet", "t1"), ("A", "dry", "t1"), ("B", "dry", "t1"))
    for level in (1, 2)
)


def test_answers_of_several_conditions_are_never_pooled_silently() -> None:
    said = (
        "^t.csv: condition varies within a track: a threshold for each "
        r"\(add --columns condition=track,condition=condition\), or one for all "
        r"\(add --columns ignore=condition\)$"
    )
    with pytest.raises(TableError, match=said):
        read(TWO, "t.csv", "weibull")
    (a, b) = read(TWO, "t.csv", "weibull", "ignore=condition")
    assert (a.levels, b.levels) == ([1, 2, 1, 2], [1, 2])
    joined = read(TWO, "t.csv", "weibull", "condition=condition,condition=track")
    assert [(each.participant, each.track) for each in joined] == [
        ("A", "wet, t1"),
        ("A", "dry, t1"),
        ("B", "dry, t1"),
    ]
    alike = TWO.replace("A,dry,t1", "A,dry,t2")  # a track is of one condition
    assert len(read(alike, "t.csv", "weibull")) == 3
    with pytest.raises(TableError, match=r"session, group vary within a track: .*ignore=group"):
        read(
            "id,session,group,level,correct\nA,1,x,1,1\nA,2,y,1,1\nA,2,y,2,1\n", "t.csv", "weibull"
        )


def test_texts_that_vary_within_a_track_are_named() -> None:
    cells = cells_in(TWO.replace("condition,", "hand,").encode(), "t.csv", most=99)
    assert pooled_line(cells, None) == (
        "Left out: column hand (2 values: wet, dry). A threshold for each value: add --columns "
        "condition=track,condition=hand."
    )
    assert pooled_line(cells, "ignore=hand") == pooled_line(cells, "condition=hand") == ""
    for wet, dry, is_named in (("30", "250", True), ("1", "2", False), ("0", "1", False)):
        numbers = TWO.replace("condition,", "hand,").replace("wet", wet).replace("dry", dry)
        said = pooled_line(cells_in(numbers.encode(), "t.csv", most=99), None)
        assert (f"column hand (2 values: {wet}, {dry})" in said) == is_named


@pytest.mark.parametrize("no", ["no", "No", "False", "FALSE", "0", "", "NA"])
@pytest.mark.parametrize("level", ["level", "level_value"])
def test_the_column_excluded_is_read_as_people_write_it(level: str, no: str) -> None:
    text = f"participant,track,{level},correct,excluded\nP,T,1,1,{no}\nP,T,2,1,TRUE\nP,T,3,1,late\n"
    (track,) = read(text, "t.csv", "weibull")
    assert (track.levels, track.left_out["excluded"]) == ([1], 2)
    with pytest.raises(TableError, match=r"got none; 3 rows: 3 excluded \(column excluded\)$"):
        read(text.replace(f",1,{no}\n", ",1,1\n", 1), "t.csv", "weibull")


def test_tracks_are_compared_in_one_order_and_each_persons_stand_together() -> None:
    rows = ("A,wet,1", "B,dry,1", "C,dry,1", "A,dry,1", "C,wet,1", "B,wet,1")
    text = "id,condition,volts,correct\n" + "".join(f"{row},1\n" for row in rows)
    assert [(each.participant, each.track) for each in read(text, "t.csv", "weibull")] == [
        (who, track) for who in "ABC" for track in ("wet", "dry")
    ]


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("Correct", "incorrect"), ("ja", "Nein"), ("richtig", "falsch"), ("oui", "non"),
     ("sí", "no"), ("corretto", "errato"), ("对", "错"), ("hit", "miss")],
)  # fmt: skip
def test_common_words_of_right_and_wrong(right: str, wrong: str) -> None:
    text = f"id,volts,correct\nA,1,{right}\nA,2,{wrong}\nA,3,\n"
    (track,) = read(text, "t.csv", "weibull")
    assert track.correct == [1, 0]


def test_other_words_are_told() -> None:
    text = "id,volts,response\nA,1,longer\nA,2,Shorter\nA,3,longer\n"
    said = (
        "must be 1 or 0 in a row per trial, got 'longer'; say what each means, such as --answers "
        "longer=1,shorter=0, or add --missing longer if it stands for no answer$"
    )
    with pytest.raises(TableError, match=said):
        read(text, "t.csv", "weibull")
    (track,) = read(text, "t.csv", "weibull", answers="longer=1,shorter=0")
    assert track.correct == [1, 0, 1]
    keys = text.replace("longer", "1").replace("Shorter", "2")
    (track,) = read(keys, "t.csv", "weibull", answers="2=1,1=0")
    assert track.correct == [0, 1, 0]
    with pytest.raises(TableError, match="--answers must be pairs such as longer=1,shorter=0, got"):
        read(text, "t.csv", "weibull", answers="longer=yes")
    with pytest.raises(TableError, match="the column trials counts them; add --columns ignore=tri"):
        read(f"{HEADER}P,T,1,2,1\n", "t.csv", "weibull", answers="longer=1,shorter=0")
    with pytest.raises(TableError, match="add --columns trials=NAME if it is a count, or --missin"):
        read("id,volts,yes,Anzahl\nA,1,7,9\n", "t.csv", "weibull")
