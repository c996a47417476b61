"""What the model of the answers tells: of levels and gains, of groups, of noticing, and why not."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from html import unescape

import numpy as np
import pytest

from analysis.estimates import Estimate, NotEstimable
from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report, report_files, report_html, report_json
from analysis.report.results import SENSITIVE, paragraphs
from analysis.report.sections import sensitivity
from analysis.report.wording import bounded
from analysis.sensitivity.answers_model import MOST_WIDTH, Noticed, Rated
from protocol.study.study import Study
from tests.analysis.report.sections.test_groups import STUDY, grouped
from tests.analysis.report.sections.test_measured import measured_report
from tests.analysis.report.test_report import nulls_without_reason
from tests.analysis.reports import (
    EXTENDED,
    ORIGIN,
    PAPER,
    SCORES,
    ReadPage,
    cohort,
    made,
    plain_report,
    study_report,
    with_sensitivity,
)

NAMES = ("voltage", "structure", "pressure", "frequency", "direction")
SPACE = "\N{NO-BREAK SPACE}"


@cache
def of_people(count: int) -> Report:
    """The report of the extended study, 20 trials a person: with nine the gains are told."""
    data = load_study_data(cohort(EXTENDED, count), rehearsals=False, rules=EXTENDED.exclusions)
    return report("a study", data, EXTENDED, ORIGIN)


@cache
def of_groups() -> Report:
    return report("a study", grouped(3), STUDY, ORIGIN)


@cache
def of_sessions() -> Report:
    """Four people in two sessions of the paper's study."""
    chains = []
    for session, seed in ((1, 3), (2, 4)):
        for chain in cohort(PAPER, 4, seed=seed):
            first, *others = chain
            payload = {**first.payload, "session": session}
            chains.append([replace(first, payload=payload), *others])
    return report("a study", load_study_data(chains, rehearsals=False), PAPER, ORIGIN)


@cache
def always() -> Report:
    """A study that asks for every score, whatever was answered."""
    study: Study = PAPER.model_copy(
        update={"rating": PAPER.rating.model_copy(update={"score_when": "always"})}
    )
    data = load_study_data(cohort(study, 4), rehearsals=False)
    return report("a study", data, study, ORIGIN)


def single() -> Report:
    return of_people(1)


def without_predictions() -> Report:
    scores = np.random.default_rng(3).integers(0, 11, (6, 3))
    return made(scores.tolist(), names=("warm", "cold", "wet"))


REPORTS: dict[str, Callable[[], Report]] = {
    "a published table": plain_report,
    "a published table of one subject": lambda: made(SCORES[:1]),
    "a published table of equal scores": lambda: made([[5, 5, 5]] * 3),
    "catch trials and levels": study_report,
    "gains that are told": lambda: of_people(9),
    "a single subject": single,
    "groups": of_groups,
    "sessions": of_sessions,
    "every trial is scored": always,
    "measured friction": measured_report,
}


# The same keys in every study.

PERSON = {"subject", "trials", "told"} | {
    f"{name}{end}" for name in ("level", "gain", "relative_gain", "bias") for end in ("", "_ci")
}
LINE = {"name", "level", "level_ci", "gain", "gain_ci"}
NOTICING = {"d", "d_ci", "criterion", "criterion_ci"}
RATING = {
    *("predictor", "contrast", "span", "equal_gains", "gain_sd_below", "told", "effects"),
    *("groups", "differences"),
    *(
        f"{name}{end}"
        for name in ("group_level", "group_gain", "group_bias", "selection")
        for end in ("", "_ci")
    ),
}


def without_reasons(record: dict[str, object]) -> set[str]:
    return {name for name in record if not name.endswith("reason")}


@pytest.mark.parametrize("study", REPORTS)
def test_json_has_the_same_keys_in_every_study_and_a_reason_for_each_missing_number(
    study: str,
) -> None:
    found = REPORTS[study]()
    numbers = report_json(found)
    asked = not study.startswith("a published table")
    assert numbers["sensitivity_model"] == ("noticing, then rating" if asked else "rating")
    named = ("sensitivity", "noticing", "rating", "sensitivity_coverage")
    parts = {name: entry for name, entry in numbers.items() if name.startswith(named)}
    assert nulls_without_reason(parts) == []
    for person in numbers["sensitivity"]:
        assert without_reasons(person) == PERSON
        assert person["told"] == ("reason" not in person)
    rating, noticing = numbers["rating"], numbers["noticing"]
    assert without_reasons(rating) == RATING
    if isinstance(found.sensitivity.rating, NotEstimable):
        assert all(not rating[name] for name in RATING - {"predictor"})
        assert (numbers["sensitivity"], numbers["sensitivity_reason"]) == ([], rating["reason"])
        assert numbers["sensitivity_coverage"] is None
    else:
        assert rating["told"] == ("reason" not in rating)
        assert all(line.keys() == LINE for line in (*rating["groups"], *rating["differences"]))
        assert "sensitivity_reason" not in numbers
        assert numbers["sensitivity_coverage"]["name"] in report_html(found)
    if noticing["group"] is None:
        assert noticing.keys() == {"group", "reason", "subjects"}
        assert noticing["subjects"] == []
    else:
        assert noticing.keys() == {"group", "subjects"}
        assert noticing["group"].keys() == NOTICING | {"lean", "lean_ci", "p", "unit", "share"}
        assert all(each.keys() == NOTICING | {"subject"} for each in noticing["subjects"])


@pytest.mark.parametrize("study", REPORTS)
def test_every_estimate_lies_within_its_interval(study: str) -> None:
    numbers = report_json(REPORTS[study]())
    group = numbers["noticing"]["group"]
    records = [
        *numbers["sensitivity"],
        numbers["rating"],
        *numbers["rating"].get("groups", ()),
        *numbers["rating"].get("differences", ()),
        *([group] if group else []),
        *numbers["noticing"]["subjects"],
    ]
    for record in records:
        for name, ends in record.items():
            if name.endswith("_ci") and ends is not None:
                assert ends[0] < record[name.removesuffix("_ci")] < ends[1], name


def test_the_page_quotes_the_simulated_studies_that_are_most_like_this_one() -> None:
    alike = report_json(of_people(9))["sensitivity_coverage"]
    told = " ".join(ReadPage(report_html(of_people(9))).words)
    assert (
        f"In the {alike['studies']} simulated studies most like this one "
        f"({alike['name']}, scored 0 to 10: " in told
    )
    assert f"held the truth: gains {bounded(alike['held']['gains'], 3)}, " in told
    of_noticing = f"d {bounded(alike['held']['d'], 3)}."
    assert of_noticing in told
    assert "group's d" not in report_html(plain_report()), "where noticing has no model"


# What stands in front: levels, or gains where they are told.


def fronts(found: Report) -> set[str]:
    return {
        figure.name
        for section in found.fronts
        for figure in section.figures
        if figure.front and figure.drawing is not None
    } & set(sensitivity.FIGURES)


@pytest.mark.parametrize("study", REPORTS)
def test_gains_stand_in_front_where_they_are_told_and_levels_where_not(study: str) -> None:
    found = REPORTS[study]()
    rating = found.sensitivity.rating
    answers = dict(paragraphs(found))
    files = report_files(found, figures=True).keys()
    if isinstance(rating, NotEstimable) or isinstance(rating.gain, NotEstimable):
        assert fronts(found) == set()
        assert SENSITIVE not in answers
        return
    name = "relative-gains" if rating.untold is None else "people-levels"
    assert fronts(found) == {name}
    assert f"figures/{name}.svg" in files
    other = {"relative-gains", "people-levels"} - {name}
    assert not {f"figures/{each}.svg" for each in other} & files
    assert ("cannot be told from these data" in answers[SENSITIVE]) == (name == "people-levels")
    page = unescape(report_html(found))
    assert answers[SENSITIVE] in page
    assert f'id="figure-{name}"' in page


def test_the_nine_people_are_told_and_the_four_are_not() -> None:
    for found, told in ((of_people(9), True), (study_report(), False), (plain_report(), False)):
        assert report_json(found)["rating"]["told"] is told


def test_levels_and_their_numbers_of_trials_are_told_with_why_gains_are_not() -> None:
    found = study_report()
    rating = found.sensitivity.rating
    assert isinstance(rating, Rated)
    assert rating.untold is not None
    answer = dict(paragraphs(found))[SENSITIVE].replace(SPACE, " ")
    lowest, *_, highest = sorted(rating.subjects, key=lambda person: person.level.value)
    low, high = f"{lowest.level.value:.1f}", f"{highest.level.value:.1f}"
    assert f"from these data: {rating.untold.reason}. " in answer
    assert f"Levels are from {low} ({lowest.subject}) to {high} ({highest.subject}), " in answer
    assert "gains differ" not in answer.casefold(), "nothing is said of what is not told"
    (figure,) = [it for it in found.figures if it.name == "people-levels"]
    assert "they are no sensitivities" in figure.caption
    assert figure.drawing is not None
    drawn = b"".join(file for file in figure.drawing.files().values() if b"<svg" in file)
    for person in rating.subjects:
        assert person.subject.encode() in drawn


def test_a_gain_of_one_person_can_be_told_where_those_of_most_are_not() -> None:
    found = of_people(6)
    numbers = report_json(found)
    low, high = found.scale
    told = [
        (line["gain_ci"][1] - line["gain_ci"][0]) * numbers["rating"]["span"]
        < MOST_WIDTH * (high - low)
        for line in numbers["sensitivity"]
    ]
    assert [line["told"] for line in numbers["sensitivity"]] == told
    assert 0 < sum(told) < 3
    assert not numbers["rating"]["told"]
    table = rows(found, "gains")
    assert [row[-1] for row in table] == ["yes" if it else "no" for it in told]


def rows(found: Report, name: str) -> list[list[str]]:
    """The rows of people of a table of the page."""
    page = unescape(report_html(found)).replace(SPACE, " ")
    table = page[page.index(f'id="{name}"') :]
    cells = [row.split("<t") for row in table[: table.index("</table>")].split("<tr")[2:]]
    texts = [[cell.partition(">")[2].partition("<")[0] for cell in row[1:]] for row in cells]
    return [row for row in texts if row[0].startswith("P")]


def test_more_trials_are_not_recommended_where_conditions_hide_the_gain_of_all() -> None:
    """Nine people's one score of five conditions: what is common is as little known as the own."""
    few = report_json(plain_report())["rating"]
    (low, high), span = few["group_gain_ci"], few["span"]
    assert (high - low) * span > MOST_WIDTH * 10
    assert "leaves more than the whole scale open" in few["reason"]
    assert "more of the same trials do not help, because conditions" in few["reason"]
    # Levels tell gains apart from effects of conditions, also where people are few.
    many = report_json(study_report())["rating"]
    (low, high), span = many["group_gain_ci"], many["span"]
    assert (high - low) * span > MOST_WIDTH * 10
    assert "times as many rated trials per person" in many["reason"]


def test_told_gains_are_compared_and_those_who_differ_named() -> None:
    found = of_people(9)
    rating = found.sensitivity.rating
    assert isinstance(rating, Rated)
    answer = dict(paragraphs(found))[SENSITIVE].replace(SPACE, " ")
    assert answer.startswith("These data do not show that gains differ between participants: ")
    assert "no participant's gain can be told from the group's" in answer
    assert "Levels are from" not in answer
    first, *others = rating.subjects
    apart = replace(first, relative_gain=Estimate(value=5.0, interval=(2.0, 8.0)))
    known = replace(rating, subjects=(apart, *others), equal_gains=0.01)
    differ = with_sensitivity(found, replace(found.sensitivity, rating=known))
    answer = dict(paragraphs(differ))[SENSITIVE].replace(SPACE, " ")
    assert answer.startswith("Gains differed between participants: equal gains have P = .01")
    assert f"one participant differed from the mean gain of the group ({first.subject})" in answer
    text = " ".join(ReadPage(report_html(differ)).words).replace(SPACE, " ")
    assert "Gains differ between people: all gains are equal with P = .01" in text


# People, groups, sessions and selection.


def test_noticing_takes_every_answer_and_rating_every_score_of_trials_that_count() -> None:
    numbers = report_json(study_report())
    subjects = numbers["noticing"]["subjects"]
    assert [entry["subject"] for entry in subjects] == ["P01", "P02", "P03", "P04"]
    assert numbers["checks"]["catch_trials"]["overall"]["false_alarms"]["trials"] == 16
    assert numbers["checks"]["drift"]["df"] > 0
    ways = numbers["directions"]
    share = sum(it["expected"] for it in ways) / sum(
        it[of] for it in ways for of in ("expected", "contrary", "same")
    )
    assert numbers["noticing"]["group"]["share"] == pytest.approx(share)
    assert [line["trials"] for line in numbers["sensitivity"]] == [
        sum(
            trial["subject"] == line["subject"]
            and trial["kind"] == "trial"
            and trial["score"] is not None
            for trial in numbers["trials"]
        )
        for line in numbers["sensitivity"]
    ]


def test_a_single_subject_without_repeats_has_no_sensitivity() -> None:
    numbers = report_json(made([[5, 7, 9, 4, 8]], names=NAMES))
    assert numbers["sensitivity"] == []
    reason = "its integration over the differences between people"
    assert reason in numbers["sensitivity_reason"]


def test_a_single_subject_has_no_relative_gain_and_no_group() -> None:
    found = single()
    numbers = report_json(found)
    (line,) = numbers["sensitivity"]
    rating = numbers["rating"]
    for name in ("group_level", "group_gain", "group_bias"):
        assert (rating[name], rating[f"{name}_ci"]) == (None, None)
        assert rating[f"{name}_reason"] == "a single subject tells nothing about a population"
    assert line["gain_ci"][0] < line["gain"] < line["gain_ci"][1]
    assert (line["relative_gain"], line["relative_gain_ci"]) == (None, None)
    assert line["relative_gain_reason"] == "a single subject has no others to compare with"
    assert "A single participant tells nothing about a group." in report_html(found)
    assert "gains differ" not in " ".join(ReadPage(report_html(found)).words)


def test_ratings_without_a_latent_scale_have_no_sensitivities() -> None:
    result = made([[5, 7, 7], [7, 7, 5], [5, 5, 7]])
    numbers = report_json(result)
    assert numbers["sensitivity"] == []
    assert "at least 3 are needed" in numbers["sensitivity_reason"]
    assert "Ratings have no model: two different ratings" in report_html(result)


def test_a_fit_with_too_few_effective_points_is_withheld(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.sensitivity.integration.LEAST_EFFECTIVE", 1e9)
    result = made()
    numbers = report_json(result)
    assert numbers["sensitivity"] == []
    assert "effective points" in numbers["sensitivity_reason"]
    assert 'id="gains"' not in report_html(result)


def test_who_gave_no_score_has_no_row_and_a_single_subject_no_group() -> None:
    scores = [[5, 7, 9, 4], [6, 8, 9, 3], [4, 6, 9, 5], [np.nan] * 4]
    page = report_html(made(scores, names=NAMES[:4]))
    table = page[page.index('id="gains"') :]
    assert ">P02<" in table[: table.index("</table>")]
    assert ">P03<" not in table[: table.index("</table>")]


def test_a_published_table_has_ratings_without_selection_and_no_noticing() -> None:
    numbers = report_json(plain_report())
    assert numbers["noticing"]["reason"] == "nobody was asked what changed"
    assert len(numbers["sensitivity"]) == len(SCORES)
    rating = numbers["rating"]
    assert (rating["selection"], rating["selection_ci"]) == (None, None)
    assert rating["selection_reason"] == "nothing was selected by the answers"
    page = report_html(plain_report())
    assert "Noticing has no model: nobody was asked what changed." in page
    assert "score what they felt" not in page


def test_where_every_trial_is_scored_nothing_was_selected() -> None:
    found = always()
    assert report_json(found)["rating"]["selection"] is None
    assert "score what they felt" not in report_html(found)
    selected = report_json(study_report())["rating"]
    assert selected["selection_ci"][0] < selected["selection"] < selected["selection_ci"][1]
    assert "score what they felt" in report_html(study_report())


@pytest.mark.parametrize(
    ("ends", "tells"),
    [
        ((-1.0, 1.0), "so these data do not tell. "),
        ((0.5, 1.0), "so they scored what they felt. "),
        ((-1.0, -0.5), "so scores fall with what is felt beyond the change. "),
    ],
)
def test_what_people_score_is_told_by_the_interval_of_the_selection(
    ends: tuple[float, float], tells: str
) -> None:
    rating = study_report().sensitivity.rating
    assert isinstance(rating, Rated)
    middle = sum(ends) / 2
    text = sensitivity.selection(replace(rating, selection=Estimate(value=middle, interval=ends)))
    assert f"(0 if they score the change itself), {tells}" in text


def test_the_gain_of_the_group_includes_or_excludes_0() -> None:
    found = study_report()
    rating = found.sensitivity.rating
    assert isinstance(rating, Rated)
    for ends, said in (((-1.0, 2.0), "includes"), ((0.5, 2.0), "excludes"), ((-2, -1), "excludes")):
        gain = Estimate(value=sum(ends) / 2, interval=ends)
        assert f", which {said} 0." in sensitivity.group_gain(found, replace(rating, gain=gain))


def test_groups_have_lines_of_their_own_and_differences() -> None:
    found = of_groups()
    rating = report_json(found)["rating"]
    young, old = rating["groups"]
    (apart,) = rating["differences"]
    assert (young["name"], old["name"], apart["name"]) == ("young", "old", "young - old")
    for name in ("level", "gain"):
        assert apart[name] == pytest.approx(young[name] - old[name], abs=0.15)
    # Scores of the old ones are higher by up to 3.
    assert apart["level_ci"][1] < 0
    middle = (young["gain"] + old["gain"]) / 2
    assert rating["group_gain"] == pytest.approx(middle, abs=0.15)
    page = report_html(found)
    tables = {attrs.get("id") for tag, attrs in ReadPage(page).tags if tag == "table"}
    assert {"sensitivity-groups", "sensitivity-groups-apart"} <= tables
    plain = {attrs.get("id") for tag, attrs in ReadPage(report_html(study_report())).tags}
    assert not {"sensitivity-groups", "sensitivity-groups-apart"} & plain
    assert "level and gain of the group" in page
    assert "level and gain of the group" not in report_html(study_report())


def test_sessions_have_effects_of_their_own_and_methods_say_so() -> None:
    found = of_sessions()
    numbers = report_json(found)
    assert [line["trials"] for line in numbers["sensitivity"]] == [
        int(found.loaded.scored["score"].notna()[found.loaded.scored["participant"] == who].sum())
        for who in found.loaded.table.subjects
    ]
    assert "an effect of the session" in report_html(found)
    assert "an effect of the session" not in report_html(study_report())


def test_scores_at_the_ceiling_are_named_and_refuse_gains() -> None:
    scores = [[10, 10, 10, 9, 7], [10, 10, 9, 10, 6], [10, 10, 10, 10, 8], [10, 8, 10, 10, 7]]
    found = made(scores, names=NAMES)
    rating = report_json(found)["rating"]
    assert rating["reason"].startswith("65% of the scores are the highest possible, above which")
    answer = dict(paragraphs(found))[SENSITIVE]
    assert "65% of the scores are the highest possible" in answer
    assert "are the highest possible; it takes each for this or more." in report_html(found)
    lower = made([[5, 7, 9, 4, 8], [4, 8, 9, 5, 7]], names=NAMES)
    assert "at least so high" not in report_html(lower)


def test_conditions_that_no_model_knows_have_no_sensitivity() -> None:
    numbers = report_json(without_predictions())
    assert numbers["sensitivity"] == []
    assert numbers["rating"]["reason"] == numbers["sensitivity_reason"] != ""


def test_skin_is_named_wherever_a_predicted_gain_stands_and_nowhere_else() -> None:
    short = "Without measured friction, a gain mixes skin with perception."
    page = report_html(of_people(9))
    assert report_json(of_people(9))["sensitivity_note"].startswith(short)
    for name in ("figure-relative-gains", "figure-sensitivity", "figure-model", "gains"):
        caption = page[page.index(f'id="{name}"') :].partition("caption>")[2].partition("caption>")
        assert short in caption[0], name
    assert short not in report_html(measured_report())
    assert report_json(measured_report())["sensitivity_note"] == ""


@pytest.mark.parametrize(
    ("ends", "said"), [((-0.5, -0.1), "more"), ((0.1, 0.5), "less"), ((-0.3, 0.1), "")]
)
def test_a_lean_is_said_only_where_it_is_known(ends: tuple[float, float], said: str) -> None:
    known = study_report().sensitivity
    assert isinstance(known.noticing, Noticed)
    lean = Estimate(value=sum(ends) / 2, interval=ends)
    other = replace(known, noticing=replace(known.noticing, lean=lean))
    found = with_sensitivity(study_report(), other)
    words = " ".join(ReadPage(report_html(found)).words)
    assert (f"is given {said} readily than its contrary" in words) == bool(said)
    assert ("readily than its contrary" in words) == bool(said)


def test_differences_of_groups_are_told_with_their_own_coverage() -> None:
    page = str(sensitivity.section(of_groups()).blocks)
    assert "; differences of groups " in page
    assert "differences of groups" not in str(sensitivity.section(study_report()).blocks)


def test_the_first_screen_explains_levels_beyond_the_scale() -> None:
    found = study_report()
    rating = found.sensitivity.rating
    assert isinstance(rating, Rated)
    assert rating.untold is not None
    for place, beyond in ((9.9, False), (10.2, True), (-0.1, True)):
        people = tuple(
            replace(person, level=replace(person.level, value=place)) for person in rating.subjects
        )
        other = replace(found.sensitivity, rating=replace(rating, subjects=people))
        answer = dict(paragraphs(with_sensitivity(found, other)))[SENSITIVE]
        assert answer.endswith("stands for ratings at its end.") == beyond
