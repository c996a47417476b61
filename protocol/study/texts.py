"""What a participant reads, in English and Chinese.

Nothing here tells what the device does in a trial or which answer is expected: the touch to make
is all that differs.
"""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from itertools import combinations
from string import Formatter
from types import MappingProxyType
from typing import get_args
from unicodedata import category, normalize

from protocol.errors import Path, Problem
from protocol.study.fields import UNWANTED, unprintable
from protocol.study.questions import ANSWERS, Rating
from protocol.study.study import Language, Study
from protocol.study.touch import Touch

_ENGLISH = {
    "welcome": "Thank you for taking part. You will touch a beam and say what you feel.",
    "touch.smooth": "Touch the marked place with your left index finger.",
    "touch.smooth.harder": "Touch the marked place and press slightly harder.",
    "touch.right": "Slide your left index finger slowly from left to right.",
    "touch.left": "Slide your left index finger slowly from right to left.",
    "touch.full": "Lay several fingers of your left hand on the beam.",
    "touch.full.harder": "Lay several fingers of your left hand on the beam and press harder.",
    "touch.full.right": "Slide several fingers of your left hand slowly from left to right.",
    "touch.full.left": "Slide several fingers of your left hand slowly from right to left.",
    "practice": "First a few trials to practise. They do not count.",
    "break": "Take a break. The session goes on when you are ready.",
    "ready": "Ready? Press Enter.",
    "touch.now": "Touch now.",
    "touch.end": "Lift your finger.",
    "remember": "Remember how this feels.",
    "question.roughness": "How did the roughness change?",
    "question.strength": "How did the effect change?",
    "question.places": "Did the smooth and the rough places swap?",
    "answer.smoother": "smoother",
    "answer.rougher": "rougher",
    "answer.stronger": "stronger",
    "answer.weaker": "weaker",
    "answer.same": "same",
    "answer.swapped": "swapped",
    "answer.not swapped": "not swapped",
    "score": "How strong is the change? 0 to 10",
    "thanks": "Thank you. The session is over.",
    "consent": "Your consent is filed as {reference}.",
    "wait": "Please wait.",
    "pause": "A short break. Please rest your hand.",
    "button.ready": "Ready (Enter)",
    "button.confirm": "Confirm (Enter)",
    "button.close": "Close (Enter)",
    "hint.start": "Answer with a mouse, a touch or the keyboard. Escape calls the operator.",
    "hint.change": "Choose with a mouse, a touch or the keys 1 to {last}, then confirm.",
    "hint.score": "Choose with a mouse, a touch, the digits or the arrow keys, then confirm.",
    "operator.called": "The operator has been called. You can go on when you like.",
}

_CHINESE = {
    "welcome": "感谢您的参与。您将触摸一根梁并描述您的感觉。",
    "touch.smooth": "请用左手食指触摸标记的位置。",
    "touch.smooth.harder": "请触摸标记的位置，稍微用力一些。",
    "touch.right": "请用左手食指从左向右慢慢滑动。",
    "touch.left": "请用左手食指从右向左慢慢滑动。",
    "touch.full": "请将左手的几根手指放在梁上。",
    "touch.full.harder": "请将左手的几根手指放在梁上，稍微用力一些。",
    "touch.full.right": "请用左手的几根手指从左向右慢慢滑动。",
    "touch.full.left": "请用左手的几根手指从右向左慢慢滑动。",
    "practice": "先进行几次练习，不计入结果。",
    "break": "请休息一下。准备好后继续。",
    "ready": "准备好了吗？请按回车键。",
    "touch.now": "请开始触摸。",
    "touch.end": "请抬起手指。",
    "remember": "请记住这种感觉。",
    "question.roughness": "粗糙程度有什么变化？",
    "question.strength": "触觉效果有什么变化？",
    "question.places": "光滑和粗糙的位置是否互换了？",
    "answer.smoother": "更光滑",
    "answer.rougher": "更粗糙",
    "answer.stronger": "更强",
    "answer.weaker": "更弱",
    "answer.same": "相同",
    "answer.swapped": "互换了",
    "answer.not swapped": "没有互换",
    "score": "变化有多明显？0 到 10 分",
    "thanks": "谢谢。实验结束。",
    "consent": "您的知情同意书编号：{reference}。",
    "wait": "请稍候。",
    "pause": "请稍作休息，放松您的手。",
    "button.ready": "准备好了（回车键）",
    "button.confirm": "确认（回车键）",
    "button.close": "关闭（回车键）",
    "hint.start": "可用鼠标、触摸或键盘回答。按 Esc 键可呼叫操作员。",
    "hint.change": "请用鼠标、触摸或数字键 1 到 {last} 选择，然后确认。",
    "hint.score": "请用鼠标、触摸、数字键或方向键选择，然后确认。",
    "operator.called": "已呼叫操作员。您可以随时继续。",
}

TEXTS: Mapping[Language, Mapping[str, str]] = MappingProxyType({"en": _ENGLISH, "zh": _CHINESE})


def study_texts(study: Study, language: Language) -> Mapping[str, str]:
    """Return all texts in `language`, the study's own before the built-in ones."""
    return {**TEXTS[language], **study.texts.get(language, {})}


def touch_text(touch: Touch) -> str:
    """Return the key of the text that says how to make `touch`."""
    if touch.instruction is not None:
        return touch.instruction
    full = ".full" if touch.coverage == "full" else ""
    if touch.place == "path":
        return f"touch{full}.{touch.direction}"
    return f"touch{full or '.smooth'}" + (".harder" if touch.press > 1 else "")


def band_names(rating: Rating, language: Language) -> tuple[str, ...]:
    """Return the bands of the scale as a participant reads them, such as `1-4 very weak`."""
    return tuple(
        f"{_span(band.first, band.last)} {getattr(band, language)}" for band in rating.bands
    )


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}-{last}"


def text_problems(study: Study) -> Iterator[Problem]:
    """Yield what is wrong with the study's own texts and with the instructions that name them."""
    items = [*study.opening, *study.condition]
    named = {touch.instruction for item in items for touch in item.touches if touch.instruction}
    for language in get_args(Language):
        own = study.texts.get(language, {})
        for key in own:
            yield from _override_problems(language, key, own[key], named)
        yield from _alike_answers(study, language)


def instruction_problem(study: Study, where: str, path: Path, touch: Touch) -> Problem | None:
    """Return what is wrong with the instruction that `touch` names, if a language lacks its text.

    Args:
        study: whose texts are looked at.
        where: the touch, in words.
        path: where the touch stands in the study file.
        touch: one of the study's.
    """
    key = touch.instruction
    lacking = (
        []
        if key is None
        else [
            language for language in get_args(Language) if key not in study_texts(study, language)
        ]
    )
    if not lacking:
        return None
    return Problem(
        where=where,
        rule="an instruction that a touch names must have a text",
        value=f"none for {key!r} in {' and '.join(lacking)}",
        hint=f"give it in {' and '.join(f'[texts.{language}]' for language in lacking)}",
        path=(*path, "instruction"),
    )


def _override_problems(
    language: Language, key: str, text: str, named: set[str]
) -> Iterator[Problem]:
    known = TEXTS[language]
    where, path = f"texts.{language}.{key}", ("texts", language, key)
    if key not in known and key not in named:
        close = get_close_matches(key, [*known, *named], n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
        yield Problem(where=where, rule="unknown key", value=repr(key), hint=hint, path=path)
    elif not _plain(text):
        yield Problem(where=where, rule="a text must not be blank", value=repr(text), path=path)
    elif key.startswith("answer.") and (text.strip().isdecimal() or text.strip()[:1] == ":"):
        yield Problem(
            where=where,
            rule="an answer must be no number, for these are typed to choose, nor begin with ':'",
            value=repr(text),
            path=path,
        )
    elif unprintable(text):
        yield Problem(where=where, rule=f"a text {UNWANTED}", value=repr(text), path=path)
    elif _fields(text) != _fields(known.get(key, "")):
        wanted = ", ".join(f"{{{name}}}" for name in _fields(known.get(key, ""))) or "none"
        yield Problem(
            where=where, rule=f"the fields in braces must be {wanted}", value=repr(text), path=path
        )


def _alike_answers(study: Study, language: Language) -> Iterator[Problem]:
    """Answers to one question that a participant could not tell apart."""
    own, texts = study.texts.get(language, {}), study_texts(study, language)
    for answers in ANSWERS.values():
        keys = [f"answer.{answer}" for answer in answers]
        for one, other in combinations(keys, 2):
            changed = next((key for key in (other, one) if key in own), None)
            if changed and _plain(texts[one]) == _plain(texts[other]):
                yield Problem(
                    where=f"texts.{language}.{changed}",
                    rule="answers to one question must differ",
                    value=f"{texts[other]!r} for {one} and {other}",
                    path=("texts", language, changed),
                )


def _plain(text: str) -> str:
    """What is seen of `text`, in whichever way it is written."""
    seen = "".join(sign for sign in normalize("NFKC", text) if category(sign) != "Cf")
    return " ".join(seen.casefold().split())


def _fields(text: str) -> list[str]:
    """Names in braces; a brace that is not closed counts as one of its own."""
    try:
        return sorted(name for _, name, _, _ in Formatter().parse(text) if name is not None)
    except ValueError:
        return ["{"]
