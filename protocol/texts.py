"""What a participant reads, in English and Chinese.

Nothing here tells what the device does in a trial or which answer is expected: the touch to make
is all that differs.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from protocol.study import Rating, Touch

Language = Literal["en", "zh"]

_ENGLISH = {
    "welcome": "Thank you for taking part. You will touch a beam and say what you feel.",
    "touch.smooth": "Touch the marked place with your left index finger.",
    "touch.smooth.harder": "Touch the marked place again and press slightly harder.",
    "touch.right": "Slide your left index finger slowly from left to right.",
    "touch.left": "Slide your left index finger slowly from right to left.",
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
    "confirm": "{answer}: press Enter to confirm, or type another.",
    "thanks": "Thank you. The session is over.",
}

_CHINESE = {
    "welcome": "感谢您的参与。您将触摸一根梁并描述您的感觉。",
    "touch.smooth": "请用左手食指触摸标记的位置。",
    "touch.smooth.harder": "请再次触摸标记的位置，稍微用力一些。",
    "touch.right": "请用左手食指从左向右慢慢滑动。",
    "touch.left": "请用左手食指从右向左慢慢滑动。",
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
    "confirm": "{answer}：按回车键确认，或输入其他答案。",
    "thanks": "谢谢。实验结束。",
}

TEXTS: Mapping[Language, Mapping[str, str]] = MappingProxyType({"en": _ENGLISH, "zh": _CHINESE})


def touch_text(touch: Touch) -> str:
    """Return the key of the text that says how to make `touch`."""
    if touch.place == "path":
        return f"touch.{touch.direction}"
    return "touch.smooth.harder" if touch.press > 1 else "touch.smooth"


def band_names(rating: Rating, language: Language) -> tuple[str, ...]:
    """Return the bands of the scale as a participant reads them, such as `1-4 very weak`."""
    return tuple(
        f"{_span(band.first, band.last)} {getattr(band, language)}" for band in rating.bands
    )


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}-{last}"
