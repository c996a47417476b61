"""The window of a session: opened for a study, in the participant's language."""

from collections.abc import Sequence
from contextlib import AbstractContextManager

from protocol.study import Language, Study
from protocol.texts import study_texts
from runner.window.fit import require_fit
from runner.window.foreseen import foreseen
from runner.window.opening import participant_window
from runner.window.pages import Wording
from runner.window.participant import WindowParticipant
from runner.window.wire import Settings


def study_window(
    touchbeam: Sequence[str],
    study: Study,
    language: Language,
    consent: str | None,
    *,
    screen: int,
    windowed: bool,
) -> AbstractContextManager[WindowParticipant]:
    """Return the window to enter before anything is driven or written down.

    Raises:
        BadInput: a text does not fit its place.
    """
    require_fit(study, language, consent)
    settings = Settings(
        wording=Wording(language=language, texts=study_texts(study, language)),
        screen=screen,
        windowed=windowed,
        foreseen=foreseen(study, consent),
    )
    return participant_window([*touchbeam, "participant-window"], settings)
