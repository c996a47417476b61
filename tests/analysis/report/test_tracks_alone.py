"""The report of a study of tracks alone, and of one with conditions beside them."""

import pytest

from analysis.loading.study_data import load_study_data
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.results import threshold_lines
from protocol.study_file.loading import parsed_study
from tests.analysis.reports import ORIGIN, plain_report
from tests.analysis.tracks import BOTH, SCORE, TRACKS, session


def made(text: str, threshold: float = 40.0) -> Report:
    study = parsed_study(text)
    chains = [session(text, f"P0{slot}", slot, threshold=threshold) for slot in (1, 2)]
    found = load_study_data(chains, rehearsals=False, rules=study.exclusions)
    return report("a study", found, study, ORIGIN)


def test_tracks_alone_are_reported_without_sections_on_conditions() -> None:
    found = made(TRACKS)
    page, told = report_html(found), report_json(found)
    assert "sections that compare those are left out" in page
    assert "two tracks alone" in page
    assert not {"table4", "friedman", "checks"} & told.keys()
    assert {each["kind"] for each in told["trials"]} == {"track"}
    assert {"track", "level_value", "reversal"} < told["trials"][0].keys()


@pytest.mark.parametrize("text", [TRACKS, BOTH], ids=["tracks alone", "with conditions"])
def test_the_results_show_the_psychometric_functions_at_first_sight(text: str) -> None:
    results, details = report_html(made(text)).split('<h2 id="details">')
    for number in (1, 2):
        assert f'<figure id="figure-psychometric-{number}">' in results
        assert f'<figure id="figure-psychometric-{number}">' not in details
        assert f'<figure id="figure-track-{number}">' in details


def test_trials_of_tracks_are_no_trials_of_conditions() -> None:
    told = report_json(made(BOTH))
    assert told["table4"]["rows"][0]["scores"] == [SCORE]
    assert "sections that compare those are left out" not in report_html(made(BOTH))


def test_thresholds_are_said_with_the_share_that_defines_them() -> None:
    found = made(BOTH)
    page, told = report_html(found), report_json(found)["thresholds"]
    assert "where a share of 0.75 is right" in page
    assert [each["track"] for each in told["cohort"]] == ["smallest amplitude", "by a staircase"]
    assert {each["participant"] for each in told["people"]} == {"P01", "P02"}
    assert told["people"][0]["threshold_at"] == 0.75
    first, second = threshold_lines(found)
    assert first.startswith("Threshold in the track smallest amplitude: ")
    assert "a Weber fraction of 0." in second
    assert "of predicted friction, where a share of 0.75 is right" in second
    assert {each["axis"] for each in told["readings"]} == {"voltage", "predicted contrast"}
    assert all(len(each["threshold_interval"]) == 2 for each in told["people"])
    names = {figure.name for figure in found.figures if figure.drawing is not None}
    assert {"track-1", "track-2", "psychometric-1", "psychometric-2"} < names
    (rated,) = (figure for figure in found.figures if figure.name == "model")
    assert rated.drawing is not None
    for track in ("smallest amplitude", "by a staircase"):
        assert f">threshold, {track}</text>" in rated.drawing.svg


def test_a_study_without_tracks_has_no_thresholds() -> None:
    found = plain_report()
    assert threshold_lines(found) == []
    assert found.thresholds is None
    assert "Thresholds" not in report_html(found)
    assert "thresholds" not in report_json(found)


def test_touches_of_the_axis_place_have_places_of_their_own() -> None:
    """A level of this axis is a place on the beam, which a touch elsewhere does not give."""
    text = TRACKS.partition("[[track]]")[0] + PLACE
    (person, _) = report_json(made(text, 0.008))["thresholds"]["people"]
    assert 0.042 <= person["threshold"] <= 0.06
    assert person["unit"] == "m"
    assert person["db"] is None


PLACE = """
[[track]]
name = "where"
task = "two intervals"
method = "constant"
axis = "place"
levels = { from = 0.042, to = 0.06, count = 6, spaced = "equal steps" }
standard = { place = "smooth", voltage_v = 100, place_m = 0.0414 }
comparison = { place = "smooth", voltage_v = 100 }
trials = 72
"""
