"""What is wrong with the texts of a study: its own, those of its languages, the names of bands."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from itertools import combinations
from string import Formatter
from unicodedata import category, normalize

from protocol.errors import Path, Problem
from protocol.study.fields import UNWANTED, unprintable
from protocol.study.languages import Language, reference_texts
from protocol.study.participant_texts import (
    band_name,
    finger_texts,
    required_codes,
    required_texts,
    study_codes,
    study_wording,
    text_path,
)
from protocol.study.questions import ANSWERS
from protocol.study.rating import Band
from protocol.study.study import Study
from protocol.study.touch import Touch


def text_problems(study: Study) -> Iterator[Problem]:
    """Yield what is wrong with the study's own texts and with the instructions that name them."""
    items = [*study.opening, *study.condition]
    named = {touch.instruction for item in items for touch in item.touches if touch.instruction}
    for code in study_codes(study):
        if code in study.languages:
            yield from _language_problems(study, code, study.languages[code], named)
        own = study.texts.get(code, {})
        for key in own:
            yield from _text_problems(("texts", code, key), own[key], named)
        yield from _alike_answers(study, code)
    for number, band in enumerate(study.rating.bands):
        yield from _band_problems(study, ("rating", "bands", number), band)


def instruction_problem(study: Study, where: str, path: Path, touch: Touch) -> Problem | None:
    """Return what is wrong with the instruction that `touch` names, if a language lacks its text.

    The touch stands at `path` of the study file; `where` says it in words.
    """
    key = touch.instruction
    if key is None:
        return None
    lacking = [
        code for code in required_codes(study) if key not in study_wording(study, code).texts
    ]
    if not lacking:
        return None
    return Problem(
        where=where,
        rule="an instruction that a touch names must have a text",
        value=f"none for {key!r} in {' and '.join(lacking)}",
        hint=f"give it in {' and '.join(f'[texts.{code}]' for code in lacking)}",
        path=(*path, "instruction"),
    )


def unnamed_problems(
    study: Study, path: Path, names: Mapping[str, str], others: Sequence[str] = ()
) -> Iterator[Problem]:
    """Yield each language that lacks its entry in `names`, and each entry of an unknown language.

    The names stand at `path` of the study file, beside the keys `others`.
    """
    known = study_codes(study)
    for code, text in names.items():
        if code not in known:
            yield _unknown_key((*path, code), (*others, *known))
        elif not plain(text) or unprintable(text):
            rule = "a text must not be blank" if not plain(text) else f"a text {UNWANTED}"
            where = dotted((*path, code))
            yield Problem(where=where, rule=rule, value=repr(text), path=(*path, code))
    for code in required_codes(study):
        if code not in names:
            built_in = code not in study.languages and code not in study.texts
            yield _not_given((*path, code), code if built_in else "")


def _band_problems(study: Study, path: Path, band: Band) -> Iterator[Problem]:
    built_in = {
        code: name
        for code in required_codes(study)
        if (name := band_name(band, study_wording(study, code))) is not None
    }
    yield from unnamed_problems(study, path, {**built_in, **band.names}, ("from", "to"))


def _language_problems(
    study: Study, code: str, language: Language, named: set[str]
) -> Iterator[Problem]:
    """What is wrong with a language of the study's own."""
    for key in required_texts(study):
        if key not in language.texts:
            yield _not_given(("languages", code, "texts", key))
    for key, text in language.texts.items():
        yield from _text_problems(("languages", code, "texts", key), text, named)


def _not_given(path: Path, code: str = "") -> Problem:
    hint = f"or leave {code!r} out of session.languages" if code else ""
    return Problem(where=dotted(path), rule="must be given", value="nothing", hint=hint, path=path)


def _unknown_key(path: Path, known: Sequence[str], more: Iterable[str] = ()) -> Problem:
    close = get_close_matches(str(path[-1]), [*known, *more], n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
    return Problem(
        where=dotted(path), rule="unknown key", value=repr(path[-1]), hint=hint, path=path
    )


def dotted(path: Path) -> str:
    """Return where `path` leads, as TOML writes it."""
    return ".".join(map(str, path))


def _text_problems(path: Path, text: str, named: set[str]) -> Iterator[Problem]:
    key, where, known = str(path[-1]), dotted(path), reference_texts()
    if key not in known and key not in named:
        yield _unknown_key(path, tuple(known), named)
    elif not plain(text):
        yield Problem(where=where, rule="a text must not be blank", value=repr(text), path=path)
    elif key.startswith("answer.") and is_typed_to_choose(text):
        yield Problem(where=where, rule=TYPED_TO_CHOOSE, value=repr(text), path=path)
    elif unprintable(text):
        yield Problem(where=where, rule=f"a text {UNWANTED}", value=repr(text), path=path)
    elif _fields(text) not in (allowed := _allowed_fields(key)):
        wanted = " or ".join(", ".join(fields) or "none" for fields in allowed)
        yield Problem(
            where=where, rule=f"the fields in braces must be {wanted}", value=repr(text), path=path
        )


TYPED_TO_CHOOSE = "an answer must be no number, for these are typed to choose, nor begin with ':'"


def is_typed_to_choose(text: str) -> bool:
    """Return whether `text` is what someone types at a terminal for another purpose."""
    return text.strip().isdecimal() or text.strip()[:1] == ":"


def _alike_answers(study: Study, code: str) -> Iterator[Problem]:
    """Answers to one question that a participant could not tell apart."""
    texts = study_wording(study, code).texts
    for answers in ANSWERS.values():
        keys = [key for answer in answers if (key := f"answer.{answer}") in texts]
        for one, other in combinations(keys, 2):
            path = text_path(study, code, other) or text_path(study, code, one)
            if path and plain(texts[one]) == plain(texts[other]):
                yield Problem(
                    where=dotted(path),
                    rule="answers to one question must differ",
                    value=f"{texts[other]!r} for {one} and {other}",
                    path=path,
                )


def plain(text: str) -> str:
    """Return what is seen of `text`, in whichever way it is written."""
    seen = "".join(sign for sign in normalize("NFKC", text) if category(sign) != "Cf")
    return " ".join(seen.casefold().split())


def _allowed_fields(key: str) -> list[list[str]]:
    """The fields of the built-in text; a study may itself name ends of the scale, hand, finger."""
    fields = _fields(reference_texts().get(key, ""))
    if key in finger_texts():
        return [fields, *([field] for field in fields if len(fields) > 1), []]
    return [fields, []] if key == "score" else [fields]


def _fields(text: str) -> list[str]:
    """What stands in braces; a brace that is not closed counts as one of its own."""
    try:
        parsed = list(Formatter().parse(text))
    except ValueError:
        return ["{"]
    return sorted(
        f"{{{name}{f'!{conversion}' if conversion else ''}{f':{form}' if form else ''}}}"
        for _, name, form, conversion in parsed
        if name is not None
    )
