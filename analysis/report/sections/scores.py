"""The table of scores, the trials behind it, how changes were answered, own questions."""

from collections.abc import Mapping, Sequence
from typing import Any

from analysis.estimates import Json, plain
from analysis.loading.response import IN_WORDS
from analysis.loading.sessions import SCORED_KINDS
from analysis.loading.study_data import KINDS, WAYS, unscored
from analysis.report import blocks
from analysis.report.findings import Findings
from analysis.report.sections.predictions import PREDICTIONS
from analysis.report.table4_text import table4_csv, table4_lines, table4_tex
from analysis.report.wording import MISSING, number
from analysis.statistics.summary import Table4
from analysis.trials.answers import Answers, answers_by_question
from device.friction.surfaces import GivenSurface
from protocol.study.languages import REFERENCE
from protocol.study.participant_texts import scale_in_words
from protocol.study.study_question import StudyQuestion

MOST_COLUMNS = 12
"""Of conditions; with more of them than subjects, tables of a crossed study turn."""


def section(found: Findings) -> blocks.Section:
    """Return the scores with their marks, and how the changes of each condition were answered."""
    main = found.table.table4
    return blocks.Section(
        title=_TITLES[found.measure],
        blocks=[score_table(found), notes(found), _directions_table(found)],
        data={
            "table4": {**_means_json(main), **_empty_json(found)},
            "directions": [
                {"condition": name, **ways._asdict()}
                for name, ways in found.trials.directions.items()
            ],
        },
        files={
            "table4.csv": table4_csv(main, found.mean_name),
            "table4.tex": table4_tex(
                main,
                # A minus sign is no character of every TeX.
                scale_in_words(found.study, found.rating),
                found.loaded.notes,
                found.loaded.marks,
                found.mean_name,
            ),
        },
    )


_NAMED = ", which is the answer that the study file names"
_TITLES = {"response": "How the changes were answered", "score": "Scores by condition"}


def _directions_table(found: Findings) -> blocks.Table | str:
    """Return the directions of the answers, and the mean response, of each condition."""
    directions = found.trials.directions
    if found.measure == "score":
        if found.published:
            return "These scores come without answers: conditions are compared by the scores alone."
        return "Nobody was asked what changed: what was felt was scored at once."
    if not directions:
        return "No change that was expected was answered."
    named = "" if found.study.imported else _NAMED
    means = dict(zip(found.loaded.table.conditions, found.trials.response_tests.means, strict=True))
    return blocks.Table(
        name="directions",
        caption=f"How often a change was answered as expected{named}, "
        "the other way, and as no change; and the mean response over participants. "
        f"{IN_WORDS}, so that every answer counts.",
        columns=blocks.columns(
            "condition", "as expected", "the other way", "no change", "mean response"
        ),
        rows=[[name, *map(str, ways), number(means[name], 2)] for name, ways in directions.items()],
    )


def own_questions(found: Findings) -> blocks.Section:
    """Return a table of the answers to each of the study's own questions."""
    asked = answers_by_question(found.study, found.loaded.answers)
    return blocks.Section(
        title="Questions of the study",
        blocks=[
            blocks.Table(
                name=f"question-{each.question.name}",
                caption=_caption(each.question),
                columns=blocks.columns("participant", "session", "about", "answer", kind="text"),
                rows=[list(map(str, said)) for said in each.said],
            )
            if each.said
            else _answer_table(each)
            for each in asked
        ],
        data={"questions": [each.as_json() for each in asked]},
    )


def _answer_table(asked: Answers) -> blocks.Table:
    """Return counts of each label, or statistics of numbers, by group."""
    question = asked.question
    statistics = ("mean", "sd", "median", "lowest", "highest")
    names = question.values or (statistics if question.is_number else ())
    rows: list[blocks.Row] = []
    for group in asked.groups:
        counts = {name: str(count) for name, count in group.counts(question).items()}
        shown = group.numbers() if question.is_number else {}
        cells = counts or {name: number(value, 2) for name, value in shown.items()}
        told = [str(len(group.given)), str(group.skipped)]
        rows.append([group.name, *told, *(cells.get(name, MISSING) for name in names)])
    titles = ["SD" if name == "sd" else name for name in names]
    return blocks.Table(
        name=f"question-{question.name}",
        caption=_caption(question),
        columns=[
            blocks.Column(name="", kind="text"),
            *blocks.columns("answers", "skipped", *titles),
        ],
        rows=rows,
    )


def _caption(question: StudyQuestion) -> str:
    # In the language of the page if the study has it.
    text = question.text.get(REFERENCE) or next(iter(question.text.values()), "")
    is_scale = question.form == "scale"
    scale = " From {:g} to {:g}.".format(*question.scale) if is_scale else ""
    unit = f" In {question.unit}." if question.unit else ""
    return f"{question.name}: {text}{scale}{unit}"


def notes(found: Findings) -> blocks.Items:
    return blocks.Items(name="table4-notes", lines=found.loaded.notes, front=True)


def score_table(found: Findings) -> blocks.Table:
    """Return the table of scores; each score links to its trials, each mean to the predictions."""
    table, empty, ways = found.loaded.table, found.loaded.empty, found.loaded.ways
    header, *rows, averages = table4_lines(
        found.table.table4, MISSING, found.loaded.marks, found.mean_name
    )
    with_trials = {(r["subject"], r["condition"]) for r in found.trial_records if _is_scored(r)}

    def score(row: int, column: int, text: str) -> blocks.Cell:
        # A dash alone would not tell a withheld score from an excluded one to a screen reader.
        is_empty = (row, column) in empty
        counts = str(ways[row, column]) if (row, column) in ways else ""
        why = counts
        if is_empty and (empty[row, column] not in WAYS or not counts):
            why = KINDS[empty[row, column]].words + f" ({counts})" * bool(counts)
        # A link needs a trial to lead to: a cell that was never reached has none.
        has_trials = (table.subjects[row], table.conditions[column]) in with_trials
        return blocks.Cell(
            text=_signed(text),
            target=_anchor("trials", row, column) if has_trials else "",
            label=f"{why}: its trials" if is_empty else "",
            why=why,
            missing=is_empty,
            anchor=_anchor("cell", row, column) if has_trials else "",
        )

    ends = 1 + len(table.conditions)
    lines: list[blocks.Row] = []
    for row, line in enumerate(rows):
        scores = (score(row, place, text) for place, text in enumerate(line[1:ends]))
        lines.append([line[0], *scores, *map(_mean, line[ends:])])
    means = (_mean(mean, target=PREDICTIONS) for mean in averages[1:ends])
    lines.append([averages[0], *means, *map(_mean, averages[ends:])])
    note = "Notes below explain the marks. " if found.loaded.marks else ""
    if found.measure == "response" and found.loaded.empty:
        note += (
            "Averages are of the scores that were given, so that a condition which few noticed can "
            "be high; the tests take responses. "
        )
    if found.loaded.catch_scores is not None:
        note += "Means are of the conditions, without catch trials, in which nothing is driven. "
    shown = blocks.Table(
        name="table4",
        label="Table 4" if found.is_papers else "",
        caption=f"Scores by subject and condition, {found.scale_in_words}. {note}".rstrip(),
        columns=blocks.columns(*header),
        rows=lines,
        footer=True,
        front=True,
    )
    return shown.turned("condition") if _is_wide(found) else shown


def _is_wide(found: Findings) -> bool:
    """Return whether conditions have room as rows alone."""
    table = found.loaded.table
    many = len(table.conditions) > max(MOST_COLUMNS, len(table.subjects))
    # Factors make many conditions; the tables of other studies stay as they were.
    return many and bool(found.study.factors)


def _mean(text: str, target: str = "") -> blocks.Cell:
    return blocks.Cell(text=_signed(text), target=target, missing=text == MISSING)


def _signed(text: str) -> str:
    """Return a number with the sign that stands before all numbers of the page."""
    return text.replace("-", "\N{MINUS SIGN}", 1) if text.startswith("-") else text


def _means_json(result: Table4) -> Json:
    """Return the table with its means; a missing score is `null`."""
    table = result.table
    return {
        "columns": list(table.conditions),
        "rows": [
            {"subject": subject, "scores": plain(scores), "comprehensive": plain(mean)}
            for subject, scores, mean in zip(
                table.subjects, table.scores, result.row_means, strict=True
            )
        ],
        "column_means": _column_means(result),
        "grand_mean": plain(result.grand_mean),
        "missing": table.missing_count,
        **_catch_json(result),
    }


def _catch_json(result: Table4) -> Json:
    """Return the mean scores of catch trials, or nothing where these were not scored."""
    if result.catch is None:
        return {}
    scores = dict(zip(result.table.subjects, plain(result.catch), strict=True))
    return {"catch": {"scores": scores, "mean": plain(result.catch_mean)}}


def _column_means(result: Table4) -> Json:
    return dict(zip(result.table.conditions, plain(result.column_means), strict=True))


def _empty_json(found: Findings) -> Json:
    """Return the reasons for empty cells, and the subjects and conditions without any score."""
    table = found.loaded.table
    subjects, conditions = unscored(table)
    return {
        "empty": [
            {"subject": table.subjects[row], "condition": table.conditions[column], "why": str(why)}
            for (row, column), why in found.loaded.empty.items()
        ],
        "unscored_subjects": list(subjects),
        "unscored_conditions": list(conditions),
    }


# All analysed trials, with the contrast that each friction law predicts for them.


def trials(found: Findings) -> blocks.Section:
    """Return a table of all trials per subject."""
    return blocks.Section(
        title="Trials",
        blocks=[
            f"All analysed trials, with their contrasts from {found.friction_source}"
            + _TOUCH * _knows_touches(found)
            + "."
            if found.is_predicted
            else "All analysed trials.",
            blocks.TableGroup(name="trial-tables", tables=_subject_tables(found)),
        ],
        data={"trials": found.trial_records},
    )


def _knows_touches(found: Findings) -> bool:
    """Return whether what was measured of a touch changes the contrast that is predicted of it."""
    is_stated = isinstance(found.origin.rig.surface, GivenSurface)
    return found.is_predicted and not (is_stated or found.study.imported)


_TOUCH = (
    ". Touch: whether the contrast is that of the touch as planned, with force or place as "
    "measured, or of a standard touch, where nothing is known of it"
)
_OF_ANSWERS = frozenset({"answer", "as expected", "response"})


def _anchor(of: str, row: int, column: int) -> str:
    return f"{of}-{row + 1}-{column + 1}"


def _is_scored(record: Mapping[str, Any]) -> bool:
    """Return whether a trial contributes to the table of scores."""
    return record["kind"] in SCORED_KINDS


def _subject_tables(found: Findings) -> list[blocks.Table]:
    """Return each subject's trials in the order of the conditions, with unscored trials last."""
    table = found.loaded.table
    places = {name: place for place, name in enumerate(table.conditions)}
    own: dict[str, list[Mapping[str, Any]]] = {name: [] for name in table.subjects}
    for record in found.trial_records:
        own[record["subject"]].append(record)
    laws = found.shown_laws
    predicted = [f"predicted, {law}" if len(laws) > 1 else "predicted" for law in laws]
    header = [
        *blocks.columns("condition", "session", "trial"),
        blocks.Column(name="kind", kind="word"),
        blocks.Column(name="level"),
        blocks.Column(name="answer", kind="word"),
        *blocks.columns("as expected", "score", "response", *predicted, "touch"),
    ]
    # Where nobody is asked what changed a score is the only answer.
    left_out = _OF_ANSWERS if found.measure == "score" else frozenset()
    if not _knows_touches(found):
        left_out |= {"touch"}
    shown = [place for place, column in enumerate(header) if column.name not in left_out]
    return [
        blocks.Table(
            name="",
            caption=f"Trials of {name}",
            columns=[header[place] for place in shown],
            rows=[[cells[place] for place in shown] for cells in _rows(found, row, of, places)],
        )
        for row, (name, of) in enumerate(own.items())
    ]


def _rows(
    found: Findings, row: int, records: Sequence[Mapping[str, Any]], places: Mapping[str, int]
) -> Sequence[blocks.Row]:
    """Return a subject's trials; the table of scores links to the first one of each condition."""

    def place(record: Mapping[str, Any]) -> int:
        return places[record["condition"]] if _is_scored(record) else len(places)

    rows: list[blocks.Row] = []
    # Trials that are not scored have no cell of the table of scores to lead back to.
    anchored = {len(places)}
    # Stable: within a condition trials stay in the order of their answers.
    for record in sorted(records, key=place):
        name, *cells = _cells(record, found.shown_laws)
        column = place(record)
        anchor = "" if column in anchored else _anchor("trials", row, column)
        anchored.add(column)
        back = _anchor("cell", row, column) if anchor else ""
        label = f"{name}: back to {found.table_name}" if anchor else ""
        rows.append([blocks.Cell(text=name, anchor=anchor, target=back, label=label), *cells])
    return rows


def _cells(record: Mapping[str, Any], laws: Sequence[str]) -> list[str]:
    is_imported = record["kind"] == "published"
    kind = "imported" if is_imported else record["kind"]
    kind += ", opposite" * bool(record["opposite"])
    is_catch = record["kind"] == "catch"
    # The source of the touch for which the contrast is predicted.
    touch = "measured" if record["touch_measured"] else "as planned"
    if is_imported:
        touch = "standard"
    return [
        record["condition"] or record.get("track") or MISSING,
        str(record["session"]),
        str(record["index"]),
        kind,
        MISSING if record["level"] is None else f"{record['level']:g}",
        record["change"] or MISSING,
        {True: "yes", False: "no", None: MISSING}[record["agrees"]],
        *(
            MISSING if record[name] is None else _signed(f"{record[name]:g}")
            for name in ("score", "response")
        ),
        # Nothing changes in a catch trial, whatever a law says of its touch at 0 V.
        *(number(None if is_catch else record["predicted"][law], 4) for law in laws),
        touch,
    ]
