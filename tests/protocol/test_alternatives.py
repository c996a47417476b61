"""Sessions of other lengths: as long as they would really be."""

import pytest
from hypothesis import given, settings

from protocol.alternatives import alternatives
from protocol.durations import session_s
from protocol.limits import problems
from protocol.plan import plan
from protocol.study import Study
from protocol.study_file import StudyError, parsed_study, template
from tests.protocol.studies import Document, documents, small_document


def test_what_a_study_allows_is_told_from_what_it_does_not() -> None:
    text = template("extended")
    for option in alternatives(parsed_study(text)):
        other = text.replace("repeats = 4", f"repeats = {option.repeats}", 1)
        if option.whole:
            study = parsed_study(other)
            assert session_s(study, plan(study, 0)) == option.duration_s
        else:
            with pytest.raises(StudyError):
                parsed_study(other)


@pytest.mark.parametrize("repeats", [1, 2, 4, 8])
def test_breaks_and_beam_swaps_are_those_of_each_session(repeats: int) -> None:
    wishes = {"group_by_beam": "session", "break_every_blocks": 4, "break_s": 300}
    wishes |= {"max_alike_in_row": 8}
    study = Study.model_validate(small_document(3, 2, repeats=repeats, **wishes))
    for option in alternatives(study):
        document = small_document(3, 2, repeats=option.repeats, **wishes)
        if option.whole:
            other = Study.model_validate(document)
            assert option.duration_s == session_s(other, plan(other, 0))
    assert [option.repeats for option in alternatives(study) if option.whole].count(repeats) == 1


@settings(max_examples=60, deadline=None)
@given(documents())
def test_every_sound_study_has_shorter_or_longer_sessions(document: Document) -> None:
    study = Study.model_validate(document)
    if problems(study):
        return
    options = {option.repeats: option for option in alternatives(study)}
    own = options[study.design.repeats]
    assert own.whole
    assert own.duration_s == session_s(study, plan(study, 0))
    assert len(options) > 1


@pytest.mark.parametrize("order", ["random", "blocks"])
def test_no_more_is_planned_than_a_study_may_ask_for(order: str) -> None:
    study = Study.model_validate(small_document(2, repeats=12, order=order))
    assert [option.repeats for option in alternatives(study)] == [1, 2, 6, 12, 13]


def test_whatever_is_wished_for_there_is_a_shorter_and_a_longer_session() -> None:
    text = template("extended").replace("catch_trials = 4", "catch_trials = 6")
    options = list(alternatives(parsed_study(text)))
    assert [option.repeats for option in options] == [1, 2, 4, 5, 8, 16]
    durations = [option.duration_s for option in options]
    assert durations == sorted(durations)
