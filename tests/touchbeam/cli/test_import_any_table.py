"""`touchbeam import` of tables of others: the study describes them, and cannot be run."""

import json
from pathlib import Path

import pytest

from tests.analysis.tables.books import book
from tests.runner.command_line import typed

LONG = "subject;force;speed;judgement;score\n" + "".join(
    f"P{who};{force};{speed};{'less' if (who + at) % 5 == 0 else 'more'};{2 + (who + at) % 4},5\n"
    for who in range(1, 9)
    for at, (force, speed) in enumerate(
        [("low", "slow"), ("low", "fast"), ("high", "slow"), ("high", "fast")] * 2
    )
)
ANSWERS = ("--answers", "more=expected,less=contrary")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    (tmp_path / "long.csv").write_text(LONG)
    place = tmp_path / "study"
    assert typed("import", tmp_path / "long.csv", place, "--scale", "1", "7", *ANSWERS) == 0
    return place


def test_the_study_is_checked_and_reported_with_its_factors(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert typed("check", study) == 0
    shown = capsys.readouterr().out
    assert "this study describes imported scores and cannot be run" in shown
    assert "Scale       1 to 7" in shown
    assert "Factor      force: low, high" in shown
    assert typed("check", study, "--json") == 0
    assert json.loads(capsys.readouterr().out)["imported"]["factors"]["speed"] == ["slow", "fast"]
    assert typed("status", study) == 0
    assert "Done: 8 of 8 participants. Next:" in capsys.readouterr().out
    assert typed("verify", study) == 0
    capsys.readouterr()
    assert typed("report", study, "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert len(report["trials"]) == 64
    assert {each["agrees"] for each in report["trials"]} == {True, False}
    page = (study / "report" / "report.html").read_text()
    for words in ("0 to 10", "very effective", "Table 4", "omprehensive"):
        assert words not in page, words


@pytest.mark.parametrize(
    "command",
    [
        ("run", "--participant", "P99", "--ratings", "virtual"),
        ("slide",),
        ("register",),
    ],
)
def test_the_study_is_not_run(
    command: tuple[str, ...], study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    name, *options = command
    assert typed(name, study, *options) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "describes imported scores and cannot be run or registered" in line


def test_a_scale_that_nobody_said_is_not_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "t.xlsx").write_bytes(book(S=[["VP", "a", "b"], ["AB", -3, 2], ["CD", None, 7]]))
    assert typed("import", tmp_path / "t.xlsx", tmp_path / "study") == 0
    shown = capsys.readouterr().out
    assert "sheet S" in shown
    assert "Scale: not known (--scale LOW HIGH says it); scores from -3 to 7." in shown
    text = (tmp_path / "study" / "study.toml").read_text()
    assert "minimum = -3\nmaximum = 7\nknown = false" in text
    assert "AB" not in text
    assert typed("check", tmp_path / "study") == 0
    assert "the ends of the scale are not known" in capsys.readouterr().out


def test_our_own_exports_are_understood(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for kind, name in (("csv", "trials.csv"), ("bids", "sub-P1/beh/sub-P1_task-long_beh.tsv")):
        out = study.parent / kind
        assert typed("export", study, out, "--format", kind) == 0
        capsys.readouterr()
        again = study.parent / f"again-{kind}"
        assert typed("import", out / name, again) == 2
        assert "above the lowest of the scale: add --scale LOW" in capsys.readouterr().err
        assert typed("import", out / name, again, "--scale", "1", "7") == 0
        shown = capsys.readouterr().out
        assert "Conditions: 4 (column condition)" in shown
        assert "Repeats: 2" in shown
        assert "expected" in shown


def test_contrasts_of_its_author_are_what_a_report_predicts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        f"P{who},{name},{score + who % 2},{contrast}\n"
        for who in range(1, 10)
        for name, score, contrast in (("a", 2, 0.1), ("b", 4, 0.2), ("c", 5, 0.4))
    ]
    (tmp_path / "t.csv").write_text("subject,item,score,contrast\n" + "".join(rows))
    assert typed("import", tmp_path / "t.csv", tmp_path / "study", "--scale", "0", "10") == 0
    capsys.readouterr()
    assert typed("report", tmp_path / "study", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert {each["predicted"]["consistent"] for each in report["trials"]} == {0.1, 0.2, 0.4}
    assert report["responses"]["slope"]["value"] > 0
    page = (tmp_path / "study" / "report" / "report.html").read_text()
    assert "the contrasts that the author of the scores states" in page
    for words in ("friction model", "First signal", "of different kinds", "Over a path"):
        assert words not in page, words
    fast = ("--studies", "2", "--null-studies", "2", "--tests-only", "--workers", "1")
    assert typed("power", tmp_path / "study", *fast, "--json") == 0
    power = json.loads(capsys.readouterr().out)
    assert power["design"]["participants"] == 9
    assert "conditions differ" in {each["name"] for each in power["tests"]}


def test_power_needs_contrasts_or_people(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "repeats = 2" in (study / "study.toml").read_text()
    capsys.readouterr()
    assert typed("power", study, "--studies", "2", "--tests-only") == 2
    assert "no contrast is predicted of every condition: write contrast" in capsys.readouterr().err


def test_power_follows_factors_and_answers(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (study / "study.toml").read_text()
    for place in range(1, 5):
        text = text.replace("factors = ", f"contrast = {place / 10}\nFACTORS = ", 1)
    (study / "study.toml").write_text(text.replace("FACTORS", "factors"))
    capsys.readouterr()
    fast = ("--studies", "2", "--null-studies", "2", "--tests-only", "--workers", "1")
    assert typed("power", study, *fast, "--json") == 0
    told, said = capsys.readouterr()
    assert "simulated as answers and scores of a change" in said
    names = {each["name"] for each in json.loads(told)["tests"]}
    assert {"effect of force", "effect of speed", "force by speed"} < names


def test_a_scale_too_long_for_a_window_is_none_for_scores_that_nobody_will_enter(
    tmp_path: Path,
) -> None:
    (tmp_path / "wide.csv").write_text("subject,a,b,c\nP1,150,300,900\nP2,200,420,800\n")
    assert typed("import", tmp_path / "wide.csv", tmp_path / "study") == 0
    assert typed("check", tmp_path / "study") == 0


FELT = "subject,item,score,felt\nP1,a,3,rougher\nP1,b,4,Smoother\nP2,a,3,rougher\nP2,b,4,same\n"
MEANT = "rougher=expected,smoother=contrary,same=same"


@pytest.mark.parametrize(
    ("table", "answers", "said"),
    [
        (FELT, MEANT, "Answers: 2 expected, 1 contrary, 1 same."),
        (
            FELT.replace("P1,a,3,rougher", "P1,a,3,nothing"),
            MEANT,
            "--answers: no column is the answer; the words stand in column felt: add --columns "
            "answer=felt",
        ),
        (
            "\n".join(
                line + line[line.rindex(",") :].replace("felt", "2") for line in FELT.splitlines()
            ),
            MEANT,
            "the words stand in columns felt, 2: add --columns answer=felt or --columns answer=2",
        ),
        (FELT, "up=expected", "no column is the answer, and none holds up; write the words as"),
        ("subject,a,b\nP1,3,4\n", "4=expected", "--answers needs a row per score"),
        (FELT.replace("Smoother", '"no, smoother"'),
         "rougher=expected,no, smoother=contrary,same=same", "1 contrary, 1 same."),
    ],
)  # fmt: skip
def test_answers_that_are_told_are_never_left_out(
    table: str, answers: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "t.csv").write_text(table)
    options = ("--scale", "1", "7", "--answers", answers)
    done = typed("import", tmp_path / "t.csv", tmp_path / "study", *options) == 0
    shown = capsys.readouterr()
    assert said in (shown.out if done else shown.err)
    assert done is said.endswith("same.")


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ('"ID","Sure, 1=low, 5=high","a","b"', "ignore=Sure, 1=low, 5=high,subject=ID"),
        ('"","Sure","a","b"', "subject=1 (without a name), ignore=sure"),
    ],
)
def test_any_name_of_a_column_can_be_told(header: str, columns: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f'{header}\n"P1","4","3","5"\n"P2","5","2","6"\n')
    assert typed("import", tmp_path / "t.csv", tmp_path / "study", "--columns", columns) == 0
    text = (tmp_path / "study" / "study.toml").read_text()
    assert text.count("[[condition]]") == 2
