"""Check, without a screen, that every text can be drawn and fits its place in the window."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import chain, product
from pathlib import Path as FilePath
from string import digits

from protocol.errors import BadInput, Path, Problem, dotted
from protocol.study import participant_texts
from protocol.study.languages import REFERENCE
from protocol.study.study import Item, Study
from protocol.study_file.limits import limit_problems
from runner import screens
from runner.window import writing
from runner.window.client import WindowParticipant, participant_window
from runner.window.elements import Text, text_height, text_width, wrapped
from runner.window.messages import Settings
from runner.window.pages import page
from runner.window.question_pages import MOST_STEPS, PageState

_NOTICES = (
    "wait", "wait.beam", "wait.touch", "touch.end", "again.force", "again.place", "again.speed",
    "pause", "thanks", "stopped",
)  # fmt: skip
_FEEDBACK = ("feedback.right", "feedback.wrong")
_FITS = "a text must fit its place on the participant's screen"
# With it the countdown of a break is as wide as it can get.
LONGEST_BREAK_S = 3600.0


def foreseen(
    study: Study, consent: str | None, folder: FilePath | None = None
) -> tuple[screens.Screen, ...]:
    """Return every screen of a session once; the screens of touches precede the questions.

    Without the study's folder marks stand elsewhere in a picture of its surface.
    """
    surface = screens.shown_surface(study, folder)
    items: tuple[Item, ...] = (*study.opening, *study.condition)
    cues = []
    for item in items:
        several = participant_texts.numbers_touches(study, REFERENCE, len(item.touches))
        for number, touch in enumerate(item.touches, start=1):
            cues.append(screens.pacing(touch, study.touch, number if several else 0, surface))
    for track in study.track:
        # Of all levels the first and the last: only their places could differ on a page.
        made = [track.standard, *(track.at(level, 0.0) for level in (0, len(track.values) - 1))]
        numbers = range(1, track.intervals + 1) if track.intervals > 1 else (0,)
        cues += [
            screens.pacing(it, study.touch, number, surface)
            for it in made
            if it
            for number in numbers
        ]
    tells = any(track.feedback for track in study.track)
    shown: list[screens.Screen] = [
        screens.Welcome(consent=consent),
        *(screens.Instruction(text=text) for text in ("remember", "practice")),
        screens.Instruction(text="break", after_s=LONGEST_BREAK_S),
        *(screens.Notice(text=text) for text in (*_NOTICES, *(_FEEDBACK if tells else ()))),
    ]
    for cue in cues:
        before = screens.Instruction(text=cue.text, touch=cue.touch)
        shown += [before, screens.lead_in(cue, study.touch), cue]
    shown += [
        *(screens.ask_change(item.question) for item in items if item.question is not None),
        *(screens.ask_track(track.found, track.intervals) for track in study.track),
        (screens.ask_rating if study.absolute else screens.ask_score)(study.rating),
        *(screens.Ask(question=it) for it in study.question if it.when != "desk"),
        *(
            screens.Instruction(text=participant_texts.page_key(at), picture=own.picture)
            for at, own in enumerate(study.page)
        ),
    ]
    # Not a set, because the window prepares them in this order.
    return tuple(screen for at, screen in enumerate(shown) if screen not in shown[:at])


_FINGER = screens.OwnFinger(position_m=0.05, force=1.0, within=0.5)
_VIEWS = (
    # Everything that can stand on a page at once, with the longest numbers.
    PageState(operator_called=True, progress=(999, 999), finger=_FINGER),
    PageState(button="saved", capitals=True),
)


def fits(text: Text) -> bool:
    lines = wrapped(text.text, text.size, text.box.width)
    widest = max(text_width(line, text.size) for line in lines)
    return widest <= text.box.width and text_height(len(lines), text.size) <= text.box.height


def room(text: Text) -> int:
    """Return how many characters of `text` fit its box."""
    lengths = range(len(text.text), 0, -1)
    return next((most for most in lengths if fits(replace(text, text=text.text[:most]))), 0)


def misfits(
    shown: tuple[screens.Screen, ...], wording: participant_texts.Wording
) -> Iterator[tuple[str, str]]:
    """Yield every text on what is `shown` that does not fit its place, once, and what to do."""
    seen = set()
    for element in _texts(shown, wording):
        text = element.text
        if text not in seen and not fits(element):
            seen.add(text)
            yield text, f"shorten it from {len(text)} characters to about {room(element)}"


def _texts(shown: tuple[screens.Screen, ...], wording: participant_texts.Wording) -> Iterator[Text]:
    pages = (page(*at, wording) for at in product(shown, _VIEWS))
    return (element for element in chain.from_iterable(pages) if isinstance(element, Text))


def fit_problems(study: Study) -> Iterator[Problem]:
    """Yield a problem for a scale that is too long, and for every text that does not fit its place.

    Checks each required language whose texts are complete. A question or a track in which something
    else is wrong has no page that could be drawn.
    """
    if study.imported:  # nobody will see it at a window
        return
    unsound = {problem.path[:2] for problem in limit_problems(study)}
    if study.rating.span > MOST_STEPS:
        lowest, highest = study.rating.minimum, study.rating.maximum
        rule = (
            f"must be at most {MOST_STEPS} above minimum = {lowest}, for the participant's screen"
        )
        yield Problem.of_key("rating.maximum", rule, highest)
    for number, question in enumerate(study.question):
        if question.kind == "scale" and question.places > MOST_STEPS:
            where, hint = f"question {question.name}, step", 'a wider step, or kind = "analogue"'
            rule = f"a scale must have at most {MOST_STEPS} steps, for the participant's screen"
            path: Path = ("question", number, "step")
            yield Problem(where, rule, str(question.places), hint, path)
            unsound.add(("question", number))
    sound = {
        kind: tuple(it for at, it in enumerate(items) if (kind, at) not in unsound)
        for kind, items in (("question", study.question), ("track", study.track))
    }
    shown = foreseen(study.model_copy(update=sound), consent=None)
    for wording in _complete_wordings(study):
        for text, hint in misfits(shown, wording):
            yield _of_text(study, wording, text, _FITS, repr(text), hint)


def writing_problems(study: Study) -> Iterator[Problem]:
    """Yield a problem for each required language with characters that cannot be drawn here.

    Which characters a font has is known of installed fonts alone, where fontconfig can be asked.
    """
    shown = foreseen(study, consent=None)
    for wording in _complete_wordings(study):
        texts = dict.fromkeys(element.text for element in _texts(shown, wording))
        rule, hint = writing.NEEDS_SHAPING, writing.WITHOUT_THEM
        wrong, seen = writing.unshaped("".join(texts)), writing.unshaped
        if not wrong:
            font, wrong = _font_here(wording, writing.signs(texts))
            rule = f"the font {font} must have every character of the texts in {wording.code}"
            hint, seen = writing.font_remedy(wording.code), lambda text: writing.signs([text])
        if wrong:
            text = next(text for text in texts if not set(wrong).isdisjoint(seen(text)))
            yield _of_text(study, wording, text, rule, writing.named(wrong), hint)


def _font_here(wording: participant_texts.Wording, signs: str) -> tuple[str, str]:
    """Return the font that the window would take and what it lacks, as far as is known here."""
    known = {font: points for font in wording.fonts if (points := writing.installed_font(font))}
    return writing.best_font(known, lambda font, sign: ord(sign) in known[font], signs) or ("", "")


def _complete_wordings(study: Study) -> Iterator[participant_texts.Wording]:
    for code in participant_texts.required_codes(study):
        # What is missing is reported elsewhere; a page without it cannot be measured.
        if not any(participant_texts.lacking(study, code)):
            yield participant_texts.study_wording(study, code)


def _of_text(
    study: Study, wording: participant_texts.Wording, text: str, rule: str, value: str, hint: str
) -> Problem:
    path = _path(study, wording, text)
    where = dotted(path) if path else f"the text in {wording.code}"
    return Problem(where, rule, value, hint, path)


def _path(study: Study, wording: participant_texts.Wording, text: str) -> Path:
    """Return the path of `text` in the study file; empty for a built-in text."""
    for key in (*study.texts.get(wording.code, {}), *wording.texts):
        path = participant_texts.text_path(study, wording.code, key)
        if path is not None and wording.texts[key] in text:
            return path
    for number, band in enumerate(study.rating.bands):
        if participant_texts.band_name(band, wording) == text:
            return participant_texts.band_path(band, number, wording.code)
    for number, label in enumerate(study.rating.labels):
        if label.names.get(wording.code) == text:
            return ("rating", "labels", number, wording.code)
    return next((path for own, path in _own_texts(study, wording.code) if text.endswith(own)), ())


def _own_texts(study: Study, code: str) -> Iterator[tuple[str, Path]]:
    for number, question in enumerate(study.question):
        path: Path = ("question", number)
        if code in question.text:
            yield question.text[code], (*path, "text", code)
        for place, label in enumerate(question.labels):
            if code in label.names:
                yield label.names[code], (*path, "labels", place, code)


def study_window(
    touchbeam: Sequence[str],
    study: Study,
    settings: Settings,
    consent: str | None,
    say: Callable[[str], None] = lambda _: None,
) -> AbstractContextManager[WindowParticipant]:
    """Return the window, to be entered before any drive; `BadInput` if it cannot show a text."""
    shown, readable_s = foreseen(study, consent, FilePath(settings.folder)), study.timing.readable_s
    # The consent's reference is known only now, so that it could not be checked with the study.
    for text, hint in misfits(shown, settings.wording):
        raise BadInput(f"{_FITS}, got {text!r}; {hint}")
    texts = [element.text for element in _texts(shown, settings.wording)]
    if wrong := writing.unshaped("".join(texts)):
        value = writing.named(wrong)
        raise BadInput(f"{writing.NEEDS_SHAPING}, got {value}; {writing.WITHOUT_THEM}")
    signs = writing.signs([*texts, digits])
    settings = replace(settings, readable_s=readable_s, foreseen=shown, signs=signs)
    return participant_window([*touchbeam, "participant-window"], settings, say=say)
