"""Every screen that a study can show: checked before anyone sits down, built before its time."""

from protocol.study import Item, Study
from protocol.texts import touch_text
from runner.pacing import pacing
from runner.screens import AskChange, AskScore, Instruction, Notice, Screen, Welcome

_NOTICES = ("wait", "touch.end", "pause", "thanks")
_INSTRUCTIONS = ("remember", "practice", "break")


def foreseen(study: Study, consent: str | None) -> tuple[Screen, ...]:
    """Return each screen once; the touches' own ones first among those of a trial."""
    items: tuple[Item, ...] = (*study.opening, *study.condition)
    touches = [touch for item in items for touch in item.touches]
    cues = [pacing(touch, study.touch) for touch in touches]
    screens: list[Screen] = [
        Welcome(consent=consent),
        *(Instruction(text=text) for text in _INSTRUCTIONS),
        *(Notice(text=text) for text in _NOTICES),
    ]
    for touch, cue in zip(touches, cues, strict=True):
        screens += [Instruction(text=touch_text(touch), touch=cue.touch), cue]
    screens += [AskChange(question=item.question) for item in items if item.question is not None]
    screens.append(AskScore(rating=study.rating))
    return tuple(screen for at, screen in enumerate(screens) if screen not in screens[:at])
