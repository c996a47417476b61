"""What is wrong with the texts of a study: its own, those of its languages, the names of bands."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from unicodedata import category, normalize

from protocol.errors import Path, Problem, dotted, listed, meant
from protocol.study.columns import GROUP, REACTION_TIME, TAKEN, TRACK_COLUMNS, names_of
from protocol.study.fields import UNWANTED, unprintable
from protocol.study.languages import reference_texts
from protocol.study.participant_texts import (
    band_name,
    finger_texts,
    required_codes,
    required_texts,
    study_codes,
    study_wording,
    text_path,
)
from protocol.study.rules import Label
from protocol.study.study import Study
from protocol.study.study_question import (
    ANSWERS,
    BETWEEN,
    KINDS,
    MEANINGS,
    MOST_LABELS,
    ONCE,
    PICTURE_NAME,
    RATING,
    SCORE,
    AskedIf,
    InstructionPage,
    StudyQuestion,
    is_digest,
    is_picture_name,
    trial_facts,
)
from protocol.study.surface import NO_PICTURE
from protocol.study.touch import Touch


def text_problems(study: Study) -> Iterator[Problem]:
    """Yield what is wrong with the study's own texts and with the instructions that name them."""
    items = [*study.opening, *study.condition]
    named = {touch.instruction for item in items for touch in item.touches if touch.instruction}
    for code in study_codes(study):
        read: dict[Path, Mapping[str, str]] = {("texts", code): study.texts.get(code, {})}
        if code in study.languages:
            own, given = ("languages", code, "texts"), study.languages[code].texts
            missing = (key for key in required_texts(study) if key not in given)
            yield from (Problem.of_key((*own, key), "must be given", "nothing") for key in missing)
            read = {own: given, **read}
        for path, texts in read.items():
            for key, text in texts.items():
                yield from _text_problems((*path, key), text, named)
        yield from _alike_answers(study, code)
    for number, band in enumerate(study.rating.bands):
        wordings = {code: study_wording(study, code) for code in required_codes(study)}
        names = {code: band_name(band, wording) for code, wording in wordings.items()}
        known = {code: name for code, name in names.items() if name is not None} | band.names
        yield from unnamed_problems(study, ("rating", "bands", number), known, ("from", "to"))
    for number, label in enumerate(study.rating.labels):
        yield from unnamed_problems(study, ("rating", "labels", number), label.names, ("at",))


def instruction_problem(study: Study, where: str, path: Path, touch: Touch) -> Problem | None:
    """Return what is wrong with the instruction that `touch` names, if a language lacks its text.

    The touch stands at `path` of the study file; `where` says it in words.
    """
    key = touch.instruction
    if key is None:
        return None
    codes = required_codes(study)
    lacking = [code for code in codes if key not in study_wording(study, code).texts]
    rule = "an instruction that a touch names must have a text"
    value = f"none for {key!r} in {' and '.join(lacking)}"
    hint = f"give it in {' and '.join(f'[texts.{code}]' for code in lacking)}"
    return Problem(where, rule, value, hint, (*path, "instruction")) if lacking else None


def unnamed_problems(
    study: Study, path: Path, names: Mapping[str, str], others: Sequence[str] = ()
) -> Iterator[Problem]:
    """Yield each language that lacks its entry in `names`, and each entry of an unknown language.

    The names stand at `path` of the study file, beside the keys `others`.
    """
    known = study_codes(study)
    for code, text in names.items():
        where = _place(study, (*path, code))
        if code not in known:
            hint = meant(code, (*others, *known))
            yield Problem.of_key((*path, code), "unknown key", repr(code), hint, where)
        elif not plain(text) or unprintable(text):
            rule = "a text must not be blank" if not plain(text) else f"a text {UNWANTED}"
            yield Problem.of_key((*path, code), rule, repr(text), where=where)
    for code in required_codes(study):
        if code not in names:
            built_in = code not in study.languages and code not in study.texts
            hint = f"or leave {code!r} out of session.languages" if built_in else ""
            where = _place(study, (*path, code))
            yield Problem.of_key((*path, code), "must be given", "nothing", hint, where)


def _place(study: Study, path: Path) -> str:
    """Return where `path` leads, with the name of a question or the number of a page."""
    match path:
        case "question", int(number), *inner:
            return f"question {study.question[number].name}, {dotted(tuple(inner))}"
        case "page", int(number), *inner:
            return f"page {number + 1}, {dotted(tuple(inner))}"
    return dotted(path)


def _text_problems(path: Path, text: str, named: set[str]) -> Iterator[Problem]:
    key, known = str(path[-1]), reference_texts()
    if key not in known and key not in named:
        yield Problem.of_key(path, "unknown key", repr(key), meant(key, known, named))
    elif not plain(text):
        yield Problem.of_key(path, "a text must not be blank", repr(text))
    # At a terminal numbers choose an answer, and a colon begins a command.
    elif key.startswith("answer.") and is_typed_to_choose(text):
        yield Problem.of_key(path, TYPED_TO_CHOOSE, repr(text))
    elif unprintable(text):
        yield Problem.of_key(path, f"a text {UNWANTED}", repr(text))
    # A field that is missing would not be told to the participant; one too many stops the page.
    elif _fields(text) not in (allowed := _allowed_fields(key)):
        wanted = " or ".join(", ".join(fields) or "none" for fields in allowed)
        yield Problem.of_key(path, f"the fields in braces must be {wanted}", repr(text))


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
            # Only where the study has a say: built-in texts are not its author's to mend.
            if path and plain(texts[one]) == plain(texts[other]):
                value = f"{texts[other]!r} for {one} and {other}"
                yield Problem.of_key(path, "answers to one question must differ", value)


def plain(text: str) -> str:
    """Return what is seen of `text`, in whichever way it is written."""
    # Signs that are written in several ways, or not seen at all, look alike to a participant.
    seen = "".join(sign for sign in normalize("NFKC", text) if category(sign) != "Cf")
    return " ".join(seen.casefold().split())


def _allowed_fields(key: str) -> list[list[str]]:
    """The fields of the built-in text; a study may itself name ends of the scale, hand, finger."""
    fields = _fields(reference_texts().get(key, ""))
    if key in finger_texts():
        return [fields, *([field] for field in fields if len(fields) > 1), []]
    return [fields, []] if key in {SCORE, RATING} else [fields]


def _fields(text: str) -> list[str]:
    """What stands in braces; a brace without its other one counts as one of its own."""
    return sorted(re.findall(r"\{[^{}]*\}|[{}]", text))


# What is wrong with a study's own questions and pages: names, keys, labels, places and texts.

_PICTURE_RULE = "must be a PNG or JPEG file in the study's folder"
_Found = Iterator[tuple[str | int, str, str, str]]
"""Key, rule, value and hint of each problem."""


def question_problems(study: Study) -> Iterator[Problem]:
    """Yield what is wrong with the study's own questions."""
    yield from _name_problems(study)
    for number, question in enumerate(study.question):
        path: Path = ("question", number)
        form = {"labels": _choices, "scale": _scale, "typed": _typed}[question.form]
        found = (*_key_problems(study, question), *form(question), *_never_asked(study, question))
        for key, rule, value, hint in found:
            yield _problem(question, (*path, key), rule, value, hint)
        yield from _texts_problems(study, path, question)


def page_problems(study: Study) -> Iterator[Problem]:
    """Yield what is wrong with the study's own pages."""
    for number, page in enumerate(study.page):
        path: Path = ("page", number)
        yield from unnamed_problems(study, (*path, "text"), page.text)
        for key, rule, value in _page(study, page):
            yield Problem(f"page {number + 1}, {key}", rule, value, path=(*path, key))


def surface_problems(study: Study) -> Iterator[Problem]:
    """Yield the files of the surface that cannot be read, and friction that no touch may state."""
    surface = study.surface
    if surface.table is not None and surface.table not in study.tables:
        rule = "must name a .csv file in the study's folder that can be read, and no link"
        yield Problem.of_key("surface.table", rule, repr(surface.table))
    # Those of the paper's beam would be places on another one.
    if surface.is_own_beam or surface.kind != "beam":
        for key in ("path_m", "smooth_place_m"):
            if key not in study.touch.model_fields_set:
                rule = "must be given where [surface] is not the paper's beam"
                yield Problem.of_key(f"touch.{key}", rule, "none")
    for rule, value in _picture_problems(study, surface.picture):
        yield Problem.of_key("surface.picture", rule, value)
    if surface.path_in_picture is not None:
        begin, end = surface.path_in_picture
        (left_m, right_m), place_m = study.touch.path_m, study.touch.smooth_place_m
        part = (place_m - left_m) / (right_m - left_m)
        if not all(
            -1e-9 <= a + part * (b - a) <= 1 + 1e-9 for a, b in zip(begin, end, strict=True)
        ):
            rule = "must lie in the picture, on the line of surface.path_in_picture"
            yield Problem.of_key("touch.smooth_place_m", rule, f"{place_m:g}")


def _page(study: Study, page: InstructionPage) -> Iterator[tuple[str, str, str]]:
    design = study.design
    is_grouped = design.group_by_beam != "no" or design.max_beam_swaps is not None
    # At most, where trials are grouped by beam.
    blocks = design.repeats * (len(study.condition) if is_grouped else 1)
    if page.block is not None and page.before != "block":
        yield "block", 'must be left out unless before = "block"', str(page.block)
    if page.block is not None and page.block > blocks:
        yield "block", f"must be at most {blocks}, the number of blocks", str(page.block)
    if page.before == "practice" and design.practice_trials == 0:
        yield "before", 'must not be "practice" without practice_trials', "one"
    for rule, value in _picture_problems(study, page.picture):
        yield "picture", rule, value


def _picture_problems(study: Study, name: str | None) -> Iterator[tuple[str, str]]:
    if name is None or name == NO_PICTURE:
        return
    if not is_picture_name(name):
        yield PICTURE_NAME, f"{name!r}; copy the picture there"
    elif not is_digest(known := study.pictures.get(name, "")):
        yield _PICTURE_RULE, f"{name!r}{f', which {known}' if known else ''}"


def _problem(question: StudyQuestion, path: Path, rule: str, value: str, hint: str = "") -> Problem:
    return Problem(f"question {question.name}, {dotted(path[2:])}", rule, value, hint, path)


def _name_problems(study: Study) -> Iterator[Problem]:
    taken = {*TAKEN, *(each.name for each in trial_facts(study.rating))}
    # Only where there are groups has an export that column.
    taken |= {GROUP.name} if study.group else set()
    taken |= set(names_of(TRACK_COLUMNS)) if study.track else set()
    for number, question in enumerate(study.question):
        name = question.name
        # A question fills two columns, and either may be taken.
        if name in taken or name + REACTION_TIME in taken:
            rule = "a question must have a name of its own, for it becomes a column"
            yield _problem(question, ("question", number, "name"), rule, repr(name), "rename it")
        taken |= {name, name + REACTION_TIME}


def _key_problems(study: Study, question: StudyQuestion) -> _Found:
    # Only what the file gives: a default is wrong for nobody.
    for key in sorted(question.model_fields_set):
        kinds = sorted(name for name, kind in KINDS.items() if key in kind.keys)
        if kinds and question.kind not in kinds:
            rule = f"must be left out where kind = {question.kind!r}"
            yield key, rule, "one", f"for {', '.join(kinds)}"
    if question.conditions and question.when != "trial":
        yield "when", 'must be "trial" where conditions are named', repr(question.when), ""
    if question.sessions == "first" and question.when not in ONCE:
        rule = 'must be "desk", "before" or "after" where sessions = "first"'
        yield "when", rule, repr(question.when), ""
    for name in question.conditions:
        if name not in study.conditions:
            known = f"known: {listed(study.conditions)}"
            yield "conditions", "must be conditions of the study", repr(name), known
    for twice in _repeated(question.conditions):
        yield "conditions", "must differ", repr(twice), "name it once"


def _never_asked(study: Study, question: StudyQuestion) -> _Found:
    """A question that depends on an answer which nobody can have given when it would be asked."""
    if (rule := question.asked_if) is None:
        return
    before = study.question[: study.question.index(question)]
    # Where no condition asks what changed, nobody can have answered that.
    facts = [each for each in trial_facts(study.rating) if each.name == SCORE or not study.absolute]
    known = {each.name: each for each in (*facts, *before)}
    other = known.get(rule.question)
    if other is None:
        must, hint = "must name a question before this one", f"known: {', '.join(known)}"
        yield "asked_if", must, repr(rule.question), hint
        return
    # Of many trials or blocks it would not be known which one is meant.
    earlier = {"desk"} if question.when == "desk" else {"desk", "before", question.when}
    if other.when not in earlier:
        yield "when", f"must be {other.when!r} as that of {other.name}", repr(question.when), ""
    everywhere = study.conditions
    if {"trial"} == {other.when, question.when} and set(other.conditions or everywhere).isdisjoint(
        question.conditions or everywhere
    ):
        yield "conditions", f"must share one with {other.name}", "none", "else it is never asked"
    if rule.question == "change":
        yield from _no_such_change(study, rule.answers, question.conditions or everywhere)
    for must, value, hint in unanswerable(rule, other):
        yield "asked_if", must, value, hint


def _no_such_change(study: Study, answers: Sequence[str], conditions: Sequence[str]) -> _Found:
    """Answers that are none to what these conditions ask."""
    of_conditions = {each.question for each in study.condition if each.name in conditions}
    asked = [ANSWERS[question] for question in of_conditions if question is not None]
    can = [answer for answer in MEANINGS if any(answer in answers for answers in asked)]
    if can and answers and set(answers) <= MEANINGS.keys() - set(can):
        rule, value = "must say an answer to what its conditions ask", ", ".join(map(repr, answers))
        yield "asked_if", rule, value, f"known: {', '.join(can)}"


def unanswerable(rule: AskedIf, other: StudyQuestion) -> Iterator[tuple[str, str, str]]:
    """Yield rule, value and hint of what no answer to the `other` question can meet."""
    numbers = [f"{end:g}" for end in (rule.at_least, rule.at_most) if end is not None]
    told = ", ".join([*numbers, *map(repr, rule.answers)]) or "nothing"
    if other.values:
        wrong = [repr(each) for each in rule.answers if each not in other.values]
        if wrong or numbers or not rule.answers:
            must = f"must say `is`, of the answers to {other.name}"
            hint = f"known: {', '.join(other.values)}"
            yield must, next(iter(wrong), told), hint
        return
    first, last = other.steps_within(rule.at_least, rule.at_most) if other.is_number else (1, 0)
    if rule.answers or not numbers or first > last:
        must = f"must say at_least or at_most, within the numbers that answer {other.name}"
        if rule.at_least is not None and rule.at_most is not None and rule.at_least > rule.at_most:
            must = "at_least must not be above at_most"
        yield must, told, ""


def _typed(question: StudyQuestion) -> _Found:
    low, high = question.minimum, question.maximum
    if question.is_number and low is not None and high is not None and low >= high:
        yield "maximum", f"must be above minimum = {low:.15g}", f"{high:.15g}", ""


def _choices(question: StudyQuestion) -> _Found:
    if not 2 <= len(question.labels) <= MOST_LABELS:
        yield "labels", f"must be 2 to {MOST_LABELS}", str(len(question.labels)), ""
    for value in _without(question.labels, "value"):
        yield "labels", 'must each have a value, such as { value = "left", en = "…" }', value, ""
    for twice in _repeated(question.values):
        yield "labels", "must have values that differ", repr(twice), ""
    for value in question.values:
        # Several values stand in one cell, and a terminal strips what is typed.
        if BETWEEN in value or value != value.strip() or is_typed_to_choose(value):
            rule = f"a value must have no {BETWEEN!r} or spaces at its ends, and be no number"
            yield "labels", rule, repr(value), ""


def _scale(question: StudyQuestion) -> _Found:
    for value in _without(question.labels, "at"):
        yield "labels", 'must each have a place, such as { at = 1, en = "…" }', value, ""
    places = [label.at for label in question.labels if label.at is not None]
    for twice in _repeated(places):
        yield "labels", "must be at places that differ", f"{twice:.15g}", ""
    if question.kind == "analogue":
        if sorted(places) != [0, 100]:
            rule = "must be two, one at = 0 and one at = 100"
            yield "labels", rule, ", ".join(f"{place:.15g}" for place in places) or "none", ""
    elif question.minimum is None or question.maximum is None:
        for key in ("minimum", "maximum"):
            if getattr(question, key) is None:
                yield key, "must be given", "nothing", ""
    else:
        yield from _places(question, places)


def _places(question: StudyQuestion, named: Sequence[float]) -> _Found:
    low, high, step = question.scale
    if low >= high:
        yield "maximum", f"must be above minimum = {low:.15g}", f"{high:.15g}", ""
    # Relative, because a step such as 0.1 is not exact in binary.
    elif abs((high - low) / step - question.places) > 1e-9 * question.places:
        rule = f"must divide the {high - low:.15g} from minimum to maximum"
        yield "step", rule, f"{step:.15g}", ""
    else:
        for place in named:
            try:
                question.answer(repr(place))
            except ValueError:
                rule = f"must be at places of the scale from {low:.15g} to {high:.15g}"
                yield "labels", rule, f"{place:.15g}", ""


def _without(labels: Iterable[Label], key: str) -> Iterator[str]:
    other = "at" if key == "value" else "value"
    for number, label in enumerate(labels, start=1):
        if getattr(label, key) is None or getattr(label, other) is not None:
            yield f"label {number} with {other}" if getattr(label, other) else f"label {number}"


def _repeated(values: Sequence[str | float]) -> list[str | float]:
    return [value for number, value in enumerate(values) if value in values[:number]]


def _texts_problems(study: Study, path: Path, question: StudyQuestion) -> Iterator[Problem]:
    yield from unnamed_problems(study, (*path, "text"), question.text)
    seen: dict[tuple[str, str], str] = {}
    for number, label in enumerate(question.labels):
        place = (*path, "labels", number)
        yield from unnamed_problems(study, place, label.names, ("value", "at"))
        for code, text in label.names.items():
            if question.values and is_typed_to_choose(text):
                yield _problem(question, (*place, code), TYPED_TO_CHOOSE, repr(text))
            if question.values and seen.setdefault((code, plain(text)), str(number)) != str(number):
                rule = "answers to one question must differ"
                yield _problem(question, (*place, code), rule, repr(text))
