"""The published table: its numbers, and what is said about tables that cannot be used."""

from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.report.table4_text import table4_csv, table4_lines
from analysis.statistics.omnibus import Friedman, friedman
from analysis.statistics.summary import table4
from analysis.tables.imported_study import described, events_of, is_papers
from analysis.tables.ratings import Imported
from analysis.tables.score_table import MOST_CONDITIONS, MOST_SUBJECTS
from analysis.tables.table_cells import TableError
from protocol.journal.events import ScoresImported
from protocol.study_file.loading import parsed_study, template
from tests.analysis.imported import imported, score_table

PUBLISHED = (Path(__file__).parents[2] / "data" / "published_scores.csv").read_text()


def test_the_averages_are_those_of_the_paper() -> None:
    result = table4(score_table(PUBLISHED))
    assert table4_lines(result)[-1] == ["average", "8.44", "8.89", "9.67", "8.33", "6.22", "8.31"]


def test_the_comprehensive_scores_are_those_of_the_paper() -> None:
    result = table4(score_table(PUBLISHED))
    assert result.row_means == pytest.approx([8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6])


def test_friedmans_test_of_the_score_table() -> None:
    test = friedman(score_table(PUBLISHED))
    assert isinstance(test, Friedman)
    assert (round(test.chi2, 4), test.df) == (21.4521, 4)


def test_a_blank_cell_is_a_missing_score_and_no_zero() -> None:
    table = score_table(PUBLISHED.replace("1,10,8", "1,,8"))
    assert np.isnan(table.scores[0, 0])
    result = table4(table)
    assert result.row_means[0] == pytest.approx((8 + 10 + 10 + 5) / 4)
    assert table4_csv(result).splitlines()[1] == "1,,8,10,10,5,8.25"


def test_a_byte_order_mark_and_other_line_ends_do_no_harm() -> None:
    text = "\ufeff" + PUBLISHED.replace("\n", "\r\n")
    assert np.array_equal(
        score_table(PUBLISHED.replace("\n", "\r")).scores, score_table(PUBLISHED).scores
    )
    assert np.array_equal(score_table(text).scores, score_table(PUBLISHED).scores)


MIXED = "subject,rough,fine\nP1,5,4\nP2,n.b.,3\nP3,n.b.,2\nP4,n.b.,2\n"


def test_a_condition_of_more_texts_than_numbers_is_not_left_out_silently() -> None:
    said = (
        r"^scores.csv: 1 of 4 cells in rough are numbers: scores \(add --missing 'n.b.'\), or no "
        r"condition \(add --columns ignore=rough\)$"
    )
    with pytest.raises(TableError, match=said):
        imported(MIXED)
    assert imported(MIXED, missing="n.b.").conditions == ("rough", "fine")
    assert imported(MIXED, "ignore=rough").conditions == ("fine",)
    remarks = "subject,a,said\nP1,1,late\nP2,2,\nP3,3,NA\n"
    assert "Left out: column said." in imported(remarks).lines
    many = "subject,a,b\n" + "".join(f"P{row},1,word {row}\n" for row in range(6)) + "P6,1,7\n"
    with pytest.raises(TableError, match=r"1 of 7 cells in b are numbers: scores \(correct or bl"):
        imported(many)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("subject,a,b\nP1,1,2\nP2,=SUM(A1:A3),3\n", r"line 3, column a: is a formula, '=SUM\(A1"),
        ("subject,a,b\nP1,1,=B2*2\nP2,3,=B3*2\n", r"line 2, column b: is a formula, '=B2\*2'"),
        ("subject,item,score\nP1,a,1\nP1,b,=C2+1\n", r"line 3, column score: is a formula, '=C"),
    ],
)
def test_a_formula_is_called_so(text: str, place: str) -> None:
    with pytest.raises(TableError, match=f"{place}.*; save the table with the values of its form"):
        imported(text)
    assert imported("subject,a,mood\nP1,1,=)\nP2,2,\n").conditions == ("a",)


QUALTRICS = """StartDate,Progress,Duration (in seconds),ResponseId,LocationLatitude,Q1_1,Q1_2
Start Date,Progress,Duration (in seconds),Response ID,Location Latitude,"How rough, please? - A",B
"{""ImportId"":""startDate"",""timeZone"":""Europe/Berlin""}","{""ImportId"":""progress""}",\
"{""ImportId"":""duration""}","{""ImportId"":""_recordId""}","{""ImportId"":""locationLatitude""}",\
"{""ImportId"":""QID1_1""}","{""ImportId"":""QID1_2""}"
2024-01-02 10:00:00,100,63,R_3nab,52.1,5,2
2024-01-02 11:00:00,100,71,R_x5Qq,,6,1
"""


def test_the_three_header_rows_of_qualtrics_are_read() -> None:
    for text in (QUALTRICS, QUALTRICS.replace('""', "'")):
        found = imported(text)
        assert found.conditions == ("Q1_1", "Q1_2")
        assert [each.score for each in found.ratings] == [5, 2, 6, 1]
        assert found.lines[0] == (
            "scores.csv: wide, a column per condition; commas, two further header rows and the own "
            "columns of Qualtrics left out."
        )
    plain = "ResponseId,Q1_1\nResponse ID,A\nR_3nab1,5\n"
    with pytest.raises(TableError, match="line 2, column Q1_1: a score must be a number"):
        imported(plain)


@pytest.mark.parametrize("name", ["受试者", "被试编号", "姓名", "被験者", "Versuchsperson"])
def test_subjects_by_other_names(name: str) -> None:
    found = imported(f"{name},a,b\nP01,1,2\nP02,3,4\n")
    assert [visit.participant for visit in found.visits] == ["P01", "P02"]


def test_the_papers_conditions_are_known_in_any_case() -> None:
    scores = imported(PUBLISHED.replace("frequency", "FREQUENCY").replace("subject", "Subject"))
    assert is_papers(scores)
    text, named = described(scores, "scores.csv", "0" * 64)
    assert text == template("paper")
    assert named.conditions == ("frequency", "structure", "voltage", "direction", "pressure")


@pytest.mark.parametrize(
    "text",
    [
        "subject,voltage,pressure\n1,3,4\n2,5,6\n",
        PUBLISHED.replace("pressure", "Colour"),
        PUBLISHED.replace("3,8", "3,11", 1),
        PUBLISHED.replace("3,8", "3,-1", 1),
        PUBLISHED.replace("subject,", "session,subject,").replace("\n", "\n2,").removesuffix("2,"),
    ],
)
def test_other_tables_describe_their_data_alone(text: str) -> None:
    scores = imported(text)
    assert not is_papers(scores)
    study = parsed_study(described(scores, "scores.csv", "0" * 64)[0])
    assert (study.imported, study.conditions) == (True, scores.conditions)
    assert not study.rating.known


def test_subjects_are_pseudonyms_as_in_sessions() -> None:
    names = ("1", "S1", "a-b_3", "NUL1", "COM10")
    table = score_table("subject,a,b\n" + "".join(f"{name},3,4\n" for name in names))
    assert table.subjects == names


@pytest.mark.parametrize(
    "name",
    ["../../x1", "=cmd1", "Р01", "受试者1", "７", "com1", "LPT9", "1" * 33, "AB", "Anna Schmidt"],
)
def test_other_subjects_are_numbered_and_their_names_not_stored(name: str) -> None:
    scores = imported(f"subject,a,b\nP01,3,4\n{name},4,5\n")
    assert [visit.participant for visit in scores.visits] == ["S01", "S02"]
    assert any("Subjects are called S01 to S02, in the order" in line for line in scores.lines)
    text, named = described(scores, "scores.csv", "0" * 64)
    assert name not in text
    assert name not in str(list(events_of(named, "scores.csv", "0" * 64)))


def test_words_with_a_number_are_shortened_to_it() -> None:
    scores = imported("subject,a,b\nSubject 1,3,4\nVP.02,4,5\nP3,1,1\n")
    assert [visit.participant for visit in scores.visits] == ["Subject1", "VP02", "P3"]
    assert "Names of subjects were shortened: Subject 1 is Subject1." in scores.lines


def test_the_guard_of_an_exported_name_is_taken_off_again() -> None:
    table = score_table("subject,'=a,'s,'-b\n1,3,4,5\n2,6,7,8\n")
    assert (table.conditions, table.subjects) == (("=a", "'s", "-b"), ("1", "2"))
    lines = table4_csv(table4(table)).splitlines()
    again = score_table("\n".join(line.rpartition(",")[0] for line in lines[:-1]))
    assert (again.conditions, again.subjects) == (table.conditions, table.subjects)


@pytest.mark.parametrize(
    ("text", "known", "message"),
    [
        (PUBLISHED.replace("3,8", "3,11", 1), {"scale": (0, 10)},
         r"line 4, column frequency: a score must lie in \[0, 10\], got 11"),
        (PUBLISHED, {"scale": (10, 0)},
         "--scale must be the lowest and the highest score, .* 10 0"),
        (PUBLISHED.replace("3,8", "3,x", 1), {}, "line 4, column frequency: .* blank, got 'x'; if"),
        (PUBLISHED.replace("3,8", "3,1_0", 1), {}, "line 4, column frequency: .* got '1_0'"),
        (PUBLISHED.replace("3,8", "3,1e3", 1), {"scale": (0, 10)}, "got 1e3"),
        (PUBLISHED.replace("3,8", "3,1e4", 1), {}, r"must lie in \[-1000, 1000\], got 1e4"),
        (PUBLISHED.replace("\n2,", "\n1,"), {},
         "line 3: 1 stands in line 2, too: repeats .*repeat=row"),
        (PUBLISHED.replace("voltage", "frequency"), {},
         "'frequency' and 'frequency' may be repeats"),
        (PUBLISHED.replace("1,10,8,10,10,5", "1,10,8"), {}, "line 2: must have 6 cells .* got 3"),
        (PUBLISHED.replace("\n3,", "\n ,"), {},
         "line 4: a subject must have a name, got none; write"),
        (PUBLISHED.replace("pressure", ""), {}, "every condition must have a name"),
        ("subject,a\n1," + "9" * 200_000, {}, "line 2: a cell must have at most 131072 characters"),
        ("subject," + "x" * 65 + "\n1,3\n", {}, "line 1: .* at most 64 characters, got 65, 'x"),
        ("subject,a\n" + "1" * 5000 + ",3\n", {}, "line 2: .* at most 64 .* got 5000, '1{20}'...$"),
        ("subject,vol\x1btage\n1,3\n", {}, r"line 1: .* no control .* got 'vol\\x1btage'"),
        ("subject,a\nP\u202e1,3\n", {}, r"line 2: .* direction of writing, got 'P\\u202e1'"),
        ("\n\nsubject,a\n\n1,3\n2,x\n", {}, "scores.csv, line 6, column a: .* got 'x'"),
        ('subject,"a,b\n1,3,4\n', {}, "line 1: a quotation mark is opened and never closed"),
        ('subject,a\n1,"3"4\n', {}, "line 2: cannot be read as CSV"),
        ("subject,a\n", {}, "must have a header and at least one row, got a header"),
        ("", {}, "must have a header and at least one row, got nothing"),
        ("subject,a,b\n1,,\n2,-,NA\n", {}, "no column holds scores|must have a score"),
        ("a,b\n1,2\n3,4\n", {}, "no column says who scored, among a, b: .* or subject=row"),
        ("subject,a,b\nP1,1,2\np1,3,4\n", {}, r"'P1' and 'p1' \(lines 2 and 3\) may be one or two"),
        ("subject,a,b\nP1,1,2\nＰ1,3,4\n", {}, "'P1' and 'Ｐ1' .* may be one or two"),
        ("subject,item,score\nP1,a,2\nP1,A,4\n", {}, "the conditions 'a' and 'A' .* may be one"),
        ("subject,a,b\nP1,1,99\nP2,3,4\nP3,2,1\n", {},
         "99 stands in 1 cell, .* --missing 99.* --sc"),
        ("subject,r1,r2,s1,s2\nP1,1,2,3,4\n", {},
         "r1, r2 may be 2 repeats .*ending.* or .*heading"),
        ("subject,item,x,y\nP1,a,2,3\nP1,b,4,3\n", {},
         "each of x, y may hold .* score=NAME.* or each"),
        ("item,P1,P2\na,2,3\nb,4,3\n", {}, "P1, P2 may be the subjects .* or different measures"),
        ("rating,score,subject,item\n1,1,P1,a\n", {}, "each of .* may be the score; add --columns"),
        ("subject,item,volts,score\nP1,a,1,2\nP1,a,2,4\nP1,b,1,2\nP1,b,2,4\n", {},
         "the column volts may be a factor .*, count repeats .*, or say something else"),
        ("subject,group,item,score\nP1,x,a,2\nP1,y,b,4\n", {},
         "P1 is in the group y and in x before"),
        ("subject,item,answer,score\nP1,a,up,2\n", {}, "answers must be expected, .* got up; say"),
        ("subject,item,answer,score\nP1,a,up,2\n", {"answers": "up"}, "--answers must be pairs"),
        ("subject,a,b\nP1,1,\u20133\nP2,2,4\nP3,3,5\n", {},
         "line 2, column b: a score must be a number or blank, got '\u20133'"),
        ("subject,texture,colour\nP1,3,5\nP2,2,4\nP3,4,1\n", {},
         "texture may be the condition or be scored: add --columns condition=texture, or condition="
         "heading"),
        ("subject,item,answer,score\nP1,a,same,2\nP1,b,expected,3\n", {},
         "answer counts with its score above the lowest of the scale: add --scale LOW HIGH"),
        ("subject,a,b\nP1,1,2\n", {"columns": "subject"}, "--columns must be pairs such as"),
        ("subject,a,b\nP1,1,2\n", {"columns": "score=c"}, "no column 'c'; there are subject, a, b"),
        ("subject,item,score,contrast\nP1,a,2,11\n", {},
         "a contrast must be a number from -10 to 10"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_or_means_two_things_is_refused(
    text: str, known: dict[str, Any], message: str
) -> None:
    with pytest.raises(TableError, match=message) as refused:
        imported(text, **known)
    assert "\n" not in str(refused.value)


def test_a_table_beyond_the_limits_is_refused() -> None:
    wide = ["subject," + ",".join(f"c{n}x" for n in range(MOST_CONDITIONS + 1))]
    with pytest.raises(TableError, match="at most 100 conditions, got 101; import them in parts"):
        imported("\n".join([*wide, "P1" + (MOST_CONDITIONS + 1) * ",1"]))
    rows = [f"{n},1" for n in range(MOST_SUBJECTS + 1)]
    with pytest.raises(TableError, match="at most 100000 subjects, got 100001; import them"):
        imported("\n".join(["subject,a", *rows]))


def ratings(scores: Imported) -> list[tuple[Any, ...]]:
    return [
        (visit.participant, visit.session, visit.group, *astuple(each)[:3])
        for visit in scores.visits
        for each in visit.ratings
    ]


def test_a_long_table_with_an_index_and_repeats() -> None:
    text = ",participant_id,trial,Bedingung,rating,rt\n" + "".join(
        f"{n},P{n // 4},{n % 4},{'ab'[n % 2]},{n % 3},0.5\n" for n in range(8)
    )
    scores = imported(text)
    assert ratings(scores)[:3] == [
        ("P0", 1, None, "a", 0.0, None), ("P0", 1, None, "b", 1.0, None),
        ("P0", 1, None, "a", 2.0, None),
    ]  # fmt: skip
    assert "Repeats: 2 of each subject and condition." in scores.lines
    assert scores.lines[-1] == "Left out: column rt."
    events = list(events_of(scores, "t.csv", "0" * 64))
    assert [each.scores for each in events] == [{"a": 1.0, "b": 0.5}, {"a": 0.5, "b": 1.5}]
    assert events[0].ratings is not None
    assert ScoresImported.from_json(events[0].to_json()) == events[0]


def test_an_index_that_begins_anew_is_no_score() -> None:
    rows = [f"{n},P{who},{'ab'[n % 2]},{n}.5\n" for who in (1, 2, 3) for n in range(2)]
    scores = imported(",participant,stimulus,slider.response\n" + "".join(rows))
    assert [each.score for each in scores.ratings] == [0.5, 1.5] * 3


def test_factors_are_crossed_and_the_last_varies_fastest() -> None:
    rows = [("high", "fast"), ("low", "slow"), ("low", "fast"), ("high", "slow")]
    cells = (f"P{who};{force};{speed};{who}\n" for who in (1, 2) for force, speed in rows)
    text = "vp;force;speed;score\n" + "".join(cells)
    scores = imported(text)
    assert scores.conditions == ("high, fast", "high, slow", "low, fast", "low, slow")
    study = parsed_study(described(scores, "t.csv", "0" * 64)[0])
    assert study.factors == {"force": ("high", "low"), "speed": ("fast", "slow")}


def test_sessions_groups_answers_and_contrasts() -> None:
    text = (
        "subject,visit,group,item,judgement,score,contrast\n"
        "P1,pre,x,a,smoother,3,0.2\nP1,pre,x,b,equal,,0.1\nP1,post,x,a,rougher,2,0.2\n"
        "P2,pre,y,a,,,0.2\nP2,pre,y,b,smoother,5,0.1\n"
    )
    scores = imported(text, answers="smoother=expected,rougher=contrary,equal=same", scale=(1, 7))
    assert ratings(scores) == [
        ("P1", 1, "x", "a", 3.0, "expected"), ("P1", 1, "x", "b", None, "same"),
        ("P1", 2, "x", "a", 2.0, "contrary"), ("P2", 1, "y", "a", None, None),
        ("P2", 1, "y", "b", 5.0, "expected"),
    ]  # fmt: skip
    assert "Sessions are numbered as they come: pre is 1, post is 2." in scores.lines
    study = parsed_study(described(scores, "t.csv", "0" * 64)[0])
    assert [(each.name, each.contrast) for each in study.condition] == [("a", 0.2), ("b", 0.1)]
    assert (study.groups, study.design.sessions) == (("x", "y"), 2)
    assert (study.rating.minimum, study.rating.maximum, study.rating.known) == (1, 7, True)
    assert study.rating.score_when == "always"


def test_a_condition_below_0_with_a_typographic_minus_is_read() -> None:
    scores = imported("subject,a,b\nP1,1,\u22123\nP2,2,\u22121\nP3,3,\u2212\n")
    assert [each.score for each in scores.ratings] == [1, -3, 2, -1, 3, None]
    assert scores.scale == (-3, 3)


def test_numbers_that_name_conditions_are_read_where_subjects_have_several_rows() -> None:
    scores = imported("subject,texture,score\nP1,40,5\nP1,80,4\nP2,40,3\nP2,80,1\n")
    assert scores.conditions == ("40", "80")


def test_who_or_what_has_no_score_is_left_out_and_said() -> None:
    scores = imported("subject,a,b,c\nP1,,,\nP2,9,10,\nP3,7,10,NA\n")
    assert [visit.participant for visit in scores.visits] == ["P2", "P3"]
    assert scores.conditions == ("a", "b")
    assert scores.lines[-1] == ("Left out: column c; subject without any score: P1.")


@pytest.mark.parametrize(
    ("text", "columns", "shape"),
    [
        ("a,b\n1,2\n3,4\n", "subject=row", (2, 2)),
        ("subject,r1,r2,s1,s2\nP1,1,2,3,4\nP2,1,2,3,4\n", "repeat=ending", (2, 2)),
        ("subject,r1,r2,s1,s2\nP1,1,2,3,4\nP2,1,2,3,4\n", "condition=heading", (2, 4)),
        ("subject,a,b\nP1,1,2\nP1,3,4\n", "repeat=row", (1, 2)),
        ("subject,item,x,y\nP1,a,2,3\nP1,b,4,3\n", "score=x", (1, 2)),
        ("subject,item,x,y\nP1,a,2,3\nP1,b,4,3\n", "condition=heading,factor=item", (1, 4)),
        ("subject,texture,colour\nP1,3,5\nP2,2,4\n", "condition=heading", (2, 2)),
        ("subject,texture,colour\nP1,3,5\nP2,2,4\n", "condition=texture", (2, 2)),
        ("subject,texture,colour\nP1,3,5\nP2,2,4\n", "score=colour", (2, 2)),
        ("item,score\na,2\nb,4\n", "subject=one", (1, 2)),
        ("who,what,how\nP1,a,2\nP1,b,4\n", "subject=who,condition=what,score=how", (1, 2)),
    ],
)
def test_columns_settle_what_could_mean_two_things(
    text: str, columns: str, shape: tuple[int, int]
) -> None:
    scores = imported(text, columns)
    assert (len({visit.participant for visit in scores.visits}), len(scores.conditions)) == shape


def test_the_papers_names_with_contrasts_of_ones_own_are_no_table_4() -> None:
    names = ("frequency", "structure", "voltage", "direction", "pressure")
    rows = [
        f"P{who},{name},{5 + at},{0.1 * at + 0.01 * who}"
        for who in (1, 2, 3)
        for at, name in enumerate(names)
    ]
    found = imported("\n".join(["subject,condition,score,contrast", *rows]))
    assert not is_papers(found)
    assert "Contrasts: they differ by row." in found.lines
    assert all(event.ratings for event in events_of(found, "t.csv", "0"))


def test_rows_that_are_alike_are_said() -> None:
    rows = "subject,item,score\nP1,x,3\nP1,y,4\nP1,x,3\nP2,x,5\n"
    said = "1 row is like another one in every cell; each counts as a repeat."
    assert said in imported(rows).lines
    assert not any(
        "like another" in line for line in imported(rows.replace("P1,x,3\nP2", "P2")).lines
    )


def test_a_blank_contrast_hides_no_other() -> None:
    found = imported("subject,condition,score,contrast\nP1,a,3,0.1\nP2,a,4,\nP1,b,5,0.2\nP2,b,6,.2")
    assert found.contrasts == {"a": 0.1, "b": 0.2}


def test_of_many_columns_twelve_are_named() -> None:
    header = ",".join(f"question {at}" for at in range(3000))
    with pytest.raises(TableError, match="question 10, question 11 and 2988 more") as error:
        imported(f"{header}\n" + "1," * 2999 + "1\n" + "1," * 2999 + "2\n")
    assert len(str(error.value)) < 500


def test_scores_that_are_too_large_are_divided() -> None:
    with pytest.raises(TableError, match=r"\[-1000, 1000\], got 5000; divide the scores, such as"):
        imported("subject,a,b\nP1,5000,2000\nP2,3000,100\n")


def test_the_counters_of_psychopy_and_gorilla_are_left_out() -> None:
    own = "loop_1.thisRepN,loop_1.thisTrialN,loop_1.thisN,loop_1.thisIndex"
    header = f"surface,{own},thisRow.t,loop_1.response,loop_1.rt,participant,expName"
    rows = [
        f"{name},{rep},{at},{2 * rep + at},{at},{rep}.{at}5,{2 + at + rep},0.4{at},{who},rough\n"
        for who in ("P1", "P2")
        for rep in (0, 1)
        for at, name in enumerate(("silk", "sand"))
    ]
    found = imported(f"{header}\n" + "".join(rows))
    assert found.conditions == ("silk", "sand")
    assert "Scores: column loop_1.response." in found.lines
    assert "Repeats: 2 of each subject and condition." in found.lines
    assert "loop_1.thisTrialN, loop_1.thisN, loop_1.thisIndex" in found.lines[-1]
    gorilla = "Event Index,Participant Private ID,Spreadsheet Row,Screen Number,fabric,Response\n"
    rows = [
        f"{at},{who},{at + 1},{at},{'ab'[at % 2]},{at}\n" for who in (71, 72) for at in range(4)
    ]
    found = imported(gorilla + "".join(rows), "condition=fabric")
    assert (len(found.visits), found.conditions) == (2, ("a", "b"))


def test_all_open_columns_are_asked_at_once() -> None:
    rows = [
        f"{who},{item},{hand},{side},{at}\n"
        for who in ("P1", "P2")
        for item in ("x", "y")
        for hand in ("L", "R")
        for at, side in enumerate(("up", "down"))
    ]
    text = "id,item,limb,side,score\n" + "".join(rows)
    said = "each of limb, side may be a factor, .*add --columns ignore=limb,ignore=side, with facto"
    with pytest.raises(TableError, match=said):
        imported(text)
    assert imported(text, "ignore=limb,ignore=side").conditions == ("x", "y")


PERSONS = "id,bmi,temp,smooth,rough,hard\n" + "".join(
    f"{who},{20.2 + who % 4},{29 + who % 3},{who % 4 + 1},{5 + who % 3},{who % 7 + 1}\n"
    for who in range(1, 9)
)


def test_columns_far_from_the_scores_are_asked_about() -> None:
    said = (
        r"bmi, temp lie far from the scores of smooth, rough, hard \(20.2 to 23.2, and 1 to 7\): no"
        r" condition \(add --columns ignore=bmi,ignore=temp\), or conditions like the others \(add "
        r"--columns condition=heading, or --scale with the ends of the scale\)"
    )
    with pytest.raises(TableError, match=said):
        imported(PERSONS)
    assert imported(PERSONS, "ignore=bmi,ignore=temp").conditions == ("smooth", "rough", "hard")
    assert len(imported(PERSONS, "condition=heading").conditions) == 5
    assert len(imported(PERSONS, scale=(0, 40)).conditions) == 5
    with pytest.raises(TableError, match=r"21.2; if the column holds no scores, .* ignore=bmi$"):
        imported(PERSONS, scale=(1, 7))


@pytest.mark.parametrize(
    "columns",
    [
        [(5, 12, 20), (30, 40, 50), (60, 75, 90)],
        [(1, 2, 1), (5, 7, 6)],
        [(2, 3, 2), (5, 6, 5)],
        [(-3, -2, -3), (2, 3, 1)],
        [(1, 1, 1), (1, 2, 1), (0, 0, 0)],
        [(3, 4, 5), (21, 30)],
    ],
)
def test_conditions_that_differ_much_are_read(columns: list[tuple[int, ...]]) -> None:
    header = ",".join(["subject", *"abcd"[: len(columns)]])
    rows = [[f"P{row}", *(c[row] if row < len(c) else "" for c in columns)] for row in range(3)]
    text = "\n".join([header, *(",".join(map(str, row)) for row in rows)])
    assert len(imported(text).conditions) == len(columns)


def test_words_that_vary_within_subjects_are_the_condition_whatever_they_are_called() -> None:
    text = "subject;M;U\nP01;rau;5,5\nP01;fein;3\nP02;rau;6\nP02;fein;4\n"
    scores = imported(text)
    assert scores.conditions == ("rau", "fein")
    assert "Subjects: 2 (column subject). Conditions: 2 (column M): rau, fein." in scores.lines
    two = "subject;M;N;U\nP1;a;x;5\nP1;a;y;3\nP1;b;x;6\nP1;b;y;4\n"
    with pytest.raises(TableError, match="each of M, N may be the condition, or a factor of it"):
        imported(two)
    assert imported(two, "factor=M,factor=N").conditions == ("a, x", "a, y", "b, x", "b, y")
    assert len(imported(two, "condition=M,ignore=N").conditions) == 2
    with pytest.raises(TableError, match="line 3: P1 stands in line 2, too: repeats"):
        imported("subject,correct,level\nP1,TRUE,5\nP1,FALSE,3\nP1,TRUE,2\n")


def test_what_tells_a_subjects_rows_apart_is_offered_before_repeats() -> None:
    words = "subject,event,a,b\nP1,first,1,2\nP1,then,3,4\nP2,first,1,1\nP2,then,3,4\n"
    said = (
        r"P1 stands in line 2, too: event may tell its rows apart, as a session \(add --columns "
        r"session=event\) or a part of the condition \(add --columns condition=heading,factor=event"
        r"\); else repeats \(add --columns repeat=row\), or another subject \(give it a name of its"
    )
    with pytest.raises(TableError, match=said):
        imported(words)
    scores = imported(words, "session=event")
    assert sorted({visit.session for visit in scores.visits}) == [1, 2]
    assert len(imported(words, "condition=heading,factor=event").conditions) == 4
    numbers = words.replace("first", "10").replace("then", "20").replace("P2,20,3", "P2,20,1")
    with pytest.raises(TableError, match="event may tell its rows apart, as a session"):
        imported(numbers)


def test_conditions_that_are_equal_numbers_are_one() -> None:
    rows = "P1,1,3\nP1,2,4\nP2,1.0,3\nP2,2.0,4\nP3,{},2\nP3,{},4\n"
    scores = imported("participant,condition,rating\n" + rows.format(1, 2))
    assert scores.conditions == ("1", "2")
    codes = "participant,condition,rating\nP1,{},3\nP1,1.5,4\nP1,1.10,2\n"
    assert imported(codes.format("1.0")).conditions == ("1.0", "1.5", "1.10")
    with pytest.raises(TableError, match=r"the conditions '1.1' and '1.10' .* may be one or two"):
        imported(codes.format("1.1"))


def test_a_score_that_is_missing_is_counted_whatever_was_answered() -> None:
    text = "subject,item,answer,score\nP1,a,expected,3\nP1,b,same,\nP2,a,contrary,NA\nP2,b,,\n"
    (said,) = (line for line in imported(text, scale=(1, 7)).lines if line.startswith("Missing"))
    assert said.startswith("Missing: 1 score blank, 2 without a score after another answer. Answ")


LEVELS = "subject,trial,grating,rough\n" + "".join(
    f"P{who},{trial},{grating},{3 + who + trial}.5\n"
    for who in (1, 2, 3)
    for trial, grating in enumerate((0.1, 0.3, 0.3, 0.1))
)


def test_numbers_that_are_alike_in_each_subjects_rows_are_asked_about() -> None:
    said = (
        r"grating has the same numbers in each subject's rows: the condition \(add --columns "
        r"condition=grating,score=rough\), or scores like rough \(add --columns condition=heading\)"
    )
    with pytest.raises(TableError, match=said):
        imported(LEVELS)
    scores = imported(LEVELS, "condition=grating,score=rough")
    assert scores.conditions == ("0.1", "0.3")
    assert len(imported(LEVELS, "condition=heading").conditions) == 2
    others = LEVELS.replace("P2,3,0.1", "P2,3,0.2")
    assert imported(others).conditions == ("grating", "rough")


def test_rows_that_say_so_are_left_out() -> None:
    text = "subject,item,rating,excluded\n" + "".join(
        f"P{who},{item},{score},{out}\n"
        for who in (1, 2)
        for item, score, out in (("a", 3, "no"), ("a", 7, "yes"), ("b", 5, ""))
    )
    scores = imported(text)
    assert [rating.score for rating in scores.ratings] == [3, 5, 3, 5]
    assert scores.lines[-1] == "Left out: column excluded; 2 rows excluded."
    assert len(imported(text, "ignore=excluded").ratings) == 6
    assert len(imported(text.replace("yes", "tired")).ratings) == 6


def test_initials_that_read_as_no_value_are_named() -> None:
    with pytest.raises(TableError, match=r"line 3: a subject must have a name, got 'NA', which"):
        imported("initials,a,b\nBK,1,2\nNA,3,4\nCD,5,6\n", "subject=initials")


def test_a_code_beyond_the_scale_may_stand_for_a_missing_score() -> None:
    said = r"got 99; if it stands for a missing score, add --missing 99; if the column holds no"
    with pytest.raises(TableError, match=said):
        imported("id,a,b\nP1,1,2\nP2,99,4\n", scale=(1, 9))
    assert len(imported("id,a,b\nP1,1,2\nP2,99,4\n", scale=(1, 9), missing="99").visits) == 2


TWO_PERSONS = "initials,age,sex,material,vas\n" + "".join(
    f"{who},{age},{sex},{material},{age + at}\n"
    for who, age, sex in (("AB", 23, "f"), ("CD", 31, "m"), ("AB", 45, "m"))
    for at, material in enumerate(("wood", "steel"))
)


def test_two_persons_of_the_same_initials_are_not_one() -> None:
    said = r"line 6: AB has the age 23 and 45: two persons \(give each a name of its own\), or one"
    with pytest.raises(TableError, match=said):
        imported(TWO_PERSONS)
    sexes = TWO_PERSONS.replace("45", "24").replace("CD,31,m,steel", "CD,32,m,steel")
    with pytest.raises(TableError, match="AB has the sex f and m"):
        imported(sexes)
    assert len(imported(sexes, "ignore=sex").visits) == 2, "a year older, in a later session"
    assert len(imported(TWO_PERSONS, "ignore=sex,ignore=age").visits) == 2
