"""What the participants of a study read: which texts, and in which words.

Nothing here tells what the device does in a trial or which answer is expected: the touch to make
is all that differs.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from protocol.errors import Path
from protocol.study.languages import (
    LATER,
    REFERENCE,
    Language,
    built_in,
    built_in_codes,
    reference_texts,
)
from protocol.study.rating import PAPERS_BANDS, PAPERS_SCALE, Band, Rating
from protocol.study.study import Study
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
    return tuple(dict.fromkeys([*built_in_codes(), *study.languages]))


def required_codes(study: Study) -> tuple[str, ...]:
    """Return the codes of the languages in which the study must be complete."""
    wanted = {*study.session.languages, *study.languages, *study.texts}
    return tuple(code for code in study_codes(study) if code in wanted)


def study_wording(study: Study, code: str) -> Wording:
    """Return all that is read in a language of the study, its own texts before the built-in ones.

    The `code` is one of `study_codes`.
    """
    read, own = language(study, code), study.texts.get(code, {})
    texts = {**read.texts, **own}
    for key, older in LATER.items():
        if older in own and key not in own:  # the study has its say, as it had before the new key
            texts[key] = own[older]
        elif key not in texts:
            texts[key] = read.texts.get(older, reference_texts()[key])
    fingers = {
        "hand": texts[f"hand.{study.session.hand}"],
        "finger": texts[f"finger.{study.session.finger}"],
    }
    for key in finger_texts():
        if key in texts:
            texts[key] = texts[key].format(**fingers)
    return Wording(
        code=code,
        texts=texts,
        bands=read.bands,
        fonts=read.fonts,
        font_package=read.font_package,
    )


def finger_texts() -> tuple[str, ...]:
    """Return the keys of the texts that may name the hand and the finger of the study."""
    return tuple(key for key, text in reference_texts().items() if "{hand}" in text)


def language(study: Study, code: str) -> Language:
    """Return a language as its file has it: the study's own before the built-in one."""
    return study.languages[code] if code in study.languages else built_in(code)


def text_path(study: Study, code: str, key: str) -> Path | None:
    """Return where in the study file a text of the study's own stands; None for a built-in one."""
    if key in study.texts.get(code, {}):
        return ("texts", code, key)
    if code in study.languages and key in study.languages[code].texts:
        return ("languages", code, "texts", key)
    return None


def touch_text(touch: Touch) -> str:
    """Return the key of the text that says how to make `touch`."""
    if touch.instruction is not None:
        return touch.instruction
    full = ".full" if touch.coverage == "full" else ""
    if touch.place == "path":
        return f"touch{full}.{touch.direction}"
    return f"touch{full or '.smooth'}" + (".harder" if touch.press > 1 else "")


def score_text(wording: Wording, rating: Rating) -> str:
    """Return the question for a score; it names the ends of the scale."""
    return wording.texts["score"].format(minimum=rating.minimum, maximum=rating.maximum)


def band_name(band: Band, wording: Wording) -> str | None:
    """Return the name of `band`: the study file's, else the language's own for the English one."""
    given = band.names.get(wording.code)
    return wording.bands.get(band.names.get(REFERENCE, "")) if given is None else given


def band_names(rating: Rating, wording: Wording) -> tuple[str, ...]:
    """Return the bands of the scale as a participant reads them, such as `1-4 very weak`."""
    return tuple(
        f"{_span(band.first, band.last)} {band_name(band, wording)}" for band in rating.bands
    )


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}-{last}"


def worded_as_built(study: Study) -> bool:
    """Return whether the study's participants read nothing but what comes with every study."""
    rating, papers = study.rating, PAPERS_SCALE
    if study.texts or study.languages:
        return False
    has_papers_ends = (rating.minimum, rating.maximum) == (papers.minimum, papers.maximum)
    return has_papers_ends and all(map(_is_papers, rating.bands))


def _is_papers(band: Band) -> bool:
    key = PAPERS_BANDS.get((band.first, band.last))
    return key is not None and all(
        code in built_in_codes() and built_in(code).bands.get(key) == name
        for code, name in band.names.items()
    )


def lacking(study: Study, code: str) -> Iterator[str]:
    """Yield what participants of the study could not read in the language `code`, in words."""
    wording = study_wording(study, code)
    touches = (touch for item in (*study.opening, *study.condition) for touch in item.touches)
    for key in dict.fromkeys([*reference_texts(), *map(touch_text, touches)]):
        if key not in wording.texts:
            yield f"the text {key!r}"
    for band in study.rating.bands:
        if band_name(band, wording) is None:
            yield f"a name of the scores {_span(band.first, band.last)}"
