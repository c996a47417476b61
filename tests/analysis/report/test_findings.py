"""Scale of the scores: named in all texts of the report and exports, and used by figures."""

import re
from dataclasses import replace
from functools import cache
from html import escape

import numpy as np
import pytest

from analysis.export.dataset import dataset
from analysis.export.formats import EXPORTS
from analysis.loading.study_data import load_study_data
from analysis.report.findings import Scale
from analysis.report.report import Report, report, report_files, report_html, report_json
from protocol.journal.events import Answered, StoredEvent
from protocol.study.participant_texts import scale_in_words
from protocol.study.rules import Band
from protocol.study_file.loading import parsed_study, template
from tests.analysis.chains import chain
from tests.analysis.reports import ORIGIN, PAPER, plain_report, session_events

SCALE = "1 to 7 (1: not at all & never; 2-4: somewhat; 5-7: a great deal)"
SEVEN = parsed_study(
    re.sub(
        r"^bands = \[.*?^\]",
        """minimum = 1
maximum = 7
bands = [
  { from = 1, to = 1, en = "not at all & never", zh = "一点也不" },
  { from = 2, to = 4, en = "somewhat", zh = "有点" },
  { from = 5, to = 7, en = "a great deal", zh = "很" },
]""",
        template("paper"),
        flags=re.DOTALL | re.MULTILINE,
    )
)


@cache
def sessions_to_seven() -> list[list[StoredEvent]]:
    """Return two sessions with scores from 1 to 6."""
    rng = np.random.default_rng(1)
    return [
        chain(
            replace(event, score=1 + event.score // 2)
            if isinstance(event, Answered) and event.score is not None
            else event
            for event in session_events(SEVEN, slot, rng)
        )
        for slot in range(2)
    ]


@cache
def to_seven() -> Report:
    found = load_study_data(sessions_to_seven(), rehearsals=False)
    return report("a study", found, SEVEN, ORIGIN)


def test_the_scale_is_the_studys_or_that_of_the_published_table() -> None:
    assert to_seven().scale == Scale(1, 7)
    assert str(to_seven().scale) == "1 to 7"
    published = replace(plain_report(), study=SEVEN)
    assert published.scale == Scale(0, 10)
    # The paper's words are those of the paper's conditions alone.
    assert published.scale_in_words == "0 to 10"
    papers = replace(published, study=PAPER)
    assert papers.scale_in_words.startswith("0 to 10 (0: no effect; 1-4: very weak; ")


def test_captions_methods_and_figures_name_the_studys_scale() -> None:
    shown = report_html(to_seven())
    scale = escape(SCALE)
    assert f"condition, {scale}." in shown
    assert f"strength of the effect from {scale}." in shown
    assert ">response, 0 to 7</text>" in shown
    assert ">rating, 1 to 7</text>" in shown
    assert "0 to 10 -->" not in shown
    latex = report_files(to_seven(), figures=False)["table4.tex"].decode()
    assert rf"condition, {SCALE}.".replace("&", r"\&") in latex
    for text in (shown, latex):
        assert not re.search("0: no effect|very effective|to 10 ", text)


@pytest.mark.parametrize("form", EXPORTS)
def test_every_export_names_the_studys_scale(form: str) -> None:
    data = dataset(sessions_to_seven(), SEVEN, "0", rehearsals=False)
    files = EXPORTS[form](data)
    assert any(f"of what was felt, from {SCALE}." in text for text in files.values())
    assert not re.search("no effect|very effective|to 10 ", "".join(files.values()))


def test_a_scale_without_english_names_has_those_that_are_read() -> None:
    bands = [
        Band.model_validate({"from": band.first, "to": band.last, "zh": band.names["zh"]})
        for band in SEVEN.rating.bands
    ]
    rating = SEVEN.rating.model_copy(update={"bands": tuple(bands)})
    assert scale_in_words(SEVEN, rating).startswith("1 to 7 (1: 一点也不; 2-4: ")
    assert scale_in_words(SEVEN, rating.model_copy(update={"bands": ()})) == "1 to 7"


def test_only_the_highest_score_of_the_scale_is_at_the_ceiling() -> None:
    assert "8% of the scores in the model are the highest possible" in report_html(plain_report())
    assert "are the highest possible" not in report_html(to_seven())


def test_responses_count_from_the_lowest_score_of_the_scale() -> None:
    """The scale begins at 1, so that the response of an expected answer is its score."""
    trials = [row for row in report_json(to_seven())["trials"] if row["kind"] == "trial"]
    assert {row["score"] for row in trials if row["agrees"]} == {4, 5}
    assert all(row["response"] == row["score"] for row in trials if row["agrees"])
    otherwise = [row for row in trials if not row["agrees"]]
    assert otherwise
    assert all((row["response"], row["score"]) == (0, None) for row in otherwise)
    assert to_seven().response_scale == Scale(0, 7)
    assert plain_report().response_scale == Scale(0, 10), "scores of a published table"
