"""What the participants of a study read: which texts, and in which words.

Nothing here tells what the device does in a trial or which answer is expected: the touch to make
is all that differs.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from protocol.errors import Path
from protocol.study import languages
from protocol.study.rules import PAPERS_BANDS, PAPERS_SCALE, Band, Label, Rating
from protocol.study.study import Study
from protocol.study.study_question import RATING, SCORE, StudyQuestion, track_question
from protocol.study.touch import Touch


@dataclass(frozen=True, kw_only=True)
class Wording:
    """What the participants of a study read in the language `code`, and the fonts for it."""

    code: str
    texts: Mapping[str, str]
    bands: Mapping[str, str]
    fonts: tuple[str, ...]
    font_package: str | None = None


def study_codes(study: Study) -> tuple[str, ...]:
    """Return the codes of the languages that the study can be read in."""
    return tuple(dict.fromkeys([*languages.built_in_codes(), *study.languages]))


def required_codes(study: Study) -> tuple[str, ...]:
    """Return the codes of the languages in which the study must be complete."""
    wanted = {*study.session.languages, *study.languages, *study.texts}
    # A default that nobody wrote demands nothing.
    if "language" in study.session.model_fields_set:
        wanted.add(study.session.language)
    # In the order of the study's codes, so that problems are listed alike each time.
    return tuple(code for code in study_codes(study) if code in wanted)


def study_wording(study: Study, code: str) -> Wording:
    """Return all that is read in a language of the study, its own texts before the built-in ones.

    The `code` is one of `study_codes`.
    """
    read, own = language(study, code), study.texts.get(code, {})
    texts = {**read.texts, **own}
    for key, older in languages.later_texts().items():
        if older in own and key not in own:  # the study has its say, as it had before the new key
            texts[key] = own[older]
        elif key not in texts:
            texts[key] = read.texts.get(older, languages.reference_texts()[key])
    parts = {"hand": study.session.hand, "finger": study.session.finger}
    fingers = {part: texts[f"{part}.{which}"] for part, which in parts.items()}
    # Only these texts: the fields of others are filled where they are shown.
    for key in finger_texts():
        if key in texts:
            texts[key] = filled(texts[key], **fingers)
    pages = enumerate(study.page)
    texts |= {page_key(number): page.text[code] for number, page in pages if code in page.text}
    return Wording(
        code=code, texts=texts, bands=read.bands, fonts=read.fonts, font_package=read.font_package
    )


_FIELD = re.compile(r"\{(\w+)\}")


def filled(text: str, **values: object) -> str:
    """Return `text` with each value in the place of its name in braces, and nothing else changed.

    >>> filled("{number} of {total}", number=3, total=9), filled("{total:>9}", total=9)
    ('3 of 9', '{total:>9}')
    """
    # Not `format`, whose widths would fill the memory with a text that somebody else wrote.
    return _FIELD.sub(lambda field: str(values.get(field[1], field[0])), text)


def finger_texts() -> tuple[str, ...]:
    """Return the keys of the texts that may name the hand and the finger of the study."""
    return tuple(key for key, text in languages.reference_texts().items() if "{hand}" in text)


def page_key(number: int) -> str:
    """Return the key of the text of a page of the study's own."""
    return f"page.{number}"


def is_own_page(key: str) -> bool:
    """Return whether a text of this key fills a page of the study's own."""
    return key.startswith("page.")


def language(study: Study, code: str) -> languages.Language:
    """Return a language as its file has it: the study's own before the built-in one."""
    return study.languages[code] if code in study.languages else languages.built_in(code)


def text_path(study: Study, code: str, key: str) -> Path | None:
    """Return where in the study file a text of the study's own stands; None for a built-in one."""
    if key in study.texts.get(code, {}):
        return ("texts", code, key)
    for number in range(len(study.page)):
        if key == page_key(number):
            return ("page", number, "text", code)
    if code in study.languages and key in study.languages[code].texts:
        return ("languages", code, "texts", key)
    return None


def numbers_touches(study: Study, code: str, touches: int) -> bool:
    """Return whether participants read which touch of a trial comes: of several, in their language.

    A study's own language that is older than these texts goes on without them.
    """
    given = {*language(study, code).texts, *study.texts.get(code, {})}
    return touches > 1 and all(f"interval.{number + 1}" in given for number in range(touches))


def touch_text(touch: Touch) -> str:
    """Return the key of the text that says how to make `touch`."""
    if touch.instruction is not None:
        return touch.instruction
    full = ".full" if touch.coverage == "full" else ""
    if touch.place == "path":
        return f"touch{full}.{touch.direction}"
    return f"touch{full or '.smooth'}" + (".harder" if touch.press > 1 else "")


def question_text(question: StudyQuestion, wording: Wording) -> str:
    """Return what `question` asks; that for a score names the ends of the scale."""
    own = question.text.get(wording.code)
    if own is not None:
        return own
    if question.name in {SCORE, RATING}:
        ends = {"minimum": question.place(0), "maximum": question.place(question.places)}
        return filled(wording.texts[question.name], **ends)
    return wording.texts[f"question.{question.name}"]


def label_text(label: Label, wording: Wording) -> str:
    """Return what is read at `label`."""
    own = label.names.get(wording.code)
    return wording.texts[f"answer.{label.value}"] if own is None else own


def band_name(band: Band, wording: Wording) -> str | None:
    """Return the name of `band`: the study file's, else the language's own for the English one."""
    given = band.names.get(wording.code)
    return wording.bands.get(band.names.get(languages.REFERENCE, "")) if given is None else given


def band_path(band: Band, number: int, code: str) -> Path:
    """Return where the name of `band` in a language stands: in the study file or the language's."""
    if code in band.names:
        return ("rating", "bands", number, code)
    return ("languages", code, "bands", band.names.get(languages.REFERENCE, ""))


def band_names(bands: Iterable[Band], wording: Wording) -> tuple[str, ...]:
    """Return bands of the scale as a participant reads them, such as `1-4 very weak`."""
    return tuple(f"{_span(band.first, band.last)} {band_name(band, wording)}" for band in bands)


def rating_question(study: Study) -> str:
    """Return the text that asks for a score, in the language of the study."""
    text, rating = study_wording(study, study.session.language).texts["rating"], study.rating
    return filled(text, minimum=rating.minimum, maximum=rating.maximum)


def scale_in_words(study: Study, rating: Rating) -> str:
    """Return the ends of a scale and its bands or labels, such as `0 to 3 (0: none; 1-3: some)`.

    In the language of reference, or in the first one of the study that has a name of each.
    """
    ends = f"{rating.minimum} to {rating.maximum}"
    if not rating.known:
        return f"{ends} (the lowest and the highest score; the ends of the scale are not known)"
    for code in (languages.REFERENCE, *study_codes(study)) if rating.bands or rating.labels else ():
        named = _named_scores(rating, study_wording(study, code))
        if all(name for _, name in named):
            return f"{ends} ({'; '.join(f'{scores}: {name}' for scores, name in named)})"
    return ends


def _named_scores(rating: Rating, wording: Wording) -> list[tuple[str, str | None]]:
    named = [(_span(it.first, it.last), band_name(it, wording)) for it in rating.bands]
    return [*named, *((f"{it.at:g}", it.names.get(wording.code)) for it in rating.labels)]


def _span(first: int, last: int) -> str:
    if first == last:
        return str(first)
    # A dash beside a sign would be read as one.
    return f"{first} to {last}" if first < 0 else f"{first}-{last}"


def worded_as_built(study: Study) -> bool:
    """Return whether the study's participants read nothing but what comes with every study."""
    rating, papers = study.rating, PAPERS_SCALE
    if study.texts or study.languages or study.question or study.page or rating.labels:
        return False
    has_papers_ends = (rating.minimum, rating.maximum) == (papers.minimum, papers.maximum)
    return has_papers_ends and all(map(_is_papers, rating.bands))


def _is_papers(band: Band) -> bool:
    key = PAPERS_BANDS.get((band.first, band.last))
    return key is not None and all(
        code in languages.built_in_codes() and languages.built_in(code).bands.get(key) == name
        for code, name in band.names.items()
    )


_OF_OWN_QUESTIONS = {"hint.several", "hint.analogue", "hint.typed", "button.skip"}
"""Texts of pages that only a study with questions of its own has."""


_OF_TRACKS = (
    "question.which_", "question.is_", "interval.", "feedback.", "answer.first", "answer.second",
    "answer.third", "answer.yes", "answer.no",
)  # fmt: skip
"""How the keys begin of texts that only a study with tracks has."""


def _track_texts(study: Study) -> Iterator[str]:
    """Yield the keys of the texts that are read in the trials of the study's tracks."""
    for track in study.track:
        question = track_question(track.found, track.intervals)
        yield f"question.{question.name}"
        yield from (f"answer.{label.value}" for label in question.labels)
        yield from (f"interval.{it}" for it in range(1, track.intervals + 1) if track.intervals > 1)
        yield from ("feedback.right", "feedback.wrong") if track.feedback else ()


def required_texts(study: Study) -> tuple[str, ...]:
    """Return the keys of the texts that every language of the study must have."""
    optional = {*languages.later_texts(), *(() if study.question else _OF_OWN_QUESTIONS)}
    # No language file is older than tracks: a study that has them says all of it in its language.
    optional -= {*_track_texts(study), *([RATING] if study.absolute else [])}
    return tuple(key for key in languages.reference_texts() if key not in optional)


def read_in_reference(study: Study, code: str) -> tuple[str, ...]:
    """Return the keys of texts that a study's own language lacks and no older one stands in for."""
    given = {*language(study, code).texts, *study.texts.get(code, {})}
    return tuple(
        key
        for key, older in languages.later_texts().items()
        if given.isdisjoint({key, older})
        and (key == "answer.not swapped" or not key.startswith((*_OF_TRACKS, RATING)))
    )


def lacking(study: Study, code: str) -> Iterator[str]:
    """Yield what participants of the study could not read in the language `code`, in words."""
    wording = study_wording(study, code)
    touches = (touch for item in (*study.opening, *study.condition) for touch in item.touches)
    pages = map(page_key, range(len(study.page)))
    for key in dict.fromkeys([*required_texts(study), *pages, *map(touch_text, touches)]):
        if key not in wording.texts:
            yield f"the text {key!r}"
    for scores, name in _named_scores(study.rating, wording):
        if name is None:
            yield f"a name of the scores {scores}"
    for question in study.question:
        named = (question.text, *(each.names for each in question.labels))
        if not all(code in names for names in named):
            yield f"a text of the question {question.name!r}"
