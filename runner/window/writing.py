"""How a line of text is drawn, and the characters that cannot be drawn.

PsychoPy draws one character of one font after the other, from left to right, and never two of them
into one. That suits most scripts. A line of Hebrew is drawn in the order in which it is seen, one
of Arabic with letters in the forms in which they are joined. Marks that a script places above,
below or around a letter, as in Hindi or Thai, cannot be drawn, nor other scripts that join letters.
"""

import shutil
import subprocess
import unicodedata
from collections.abc import Callable, Collection, Iterable
from functools import cache
from typing import Any

from protocol.study.participant_texts import Wording

_FROM_THE_RIGHT = {"R", "AL"}
_JOINED = (
    *("ADLAM", "HANIFI", "MANDAIC", "MANICHAEAN", "MONGOLIAN", "NKO", "OLD UYGHUR", "PHAGS-PA"),
    *("SOGDIAN", "SYRIAC"),
    # Signs that make one picture of several.
    *("ZERO WIDTH JOINER", "EMOJI MODIFIER", "REGIONAL INDICATOR"),
)
"""How the names of letters and signs begin, beside those of Arabic, that are joined."""


def is_from_the_right(wording: Wording) -> bool:
    """Return whether the texts of a language are read from right to left, as most letters say."""
    read = "".join(wording.texts.values())
    kinds = [unicodedata.bidirectional(sign) for sign in read]
    return sum(kind in _FROM_THE_RIGHT for kind in kinds) > kinds.count("L")


def drawn(line: str, *, from_the_right: bool = False) -> str:
    r"""Return the characters of `line` as they are drawn from left to right.

    `from_the_right` is the direction of its language. Accents become one with their letter where
    there is such a character; what is never seen is left out.

    >>> drawn("Enter: אבג")
    'Enter: גבא'
    >>> drawn("Enter: אבג", from_the_right=True)
    'גבא :Enter'
    >>> ascii(drawn("\u0644\u0627"))  # lam and alef become one
    "'\\ufefb'"
    """
    line = unicodedata.normalize("NFC", line)
    if any(unicodedata.bidirectional(sign) in _FROM_THE_RIGHT for sign in line):
        # Not `bidi.get_display`, which leaves brackets as they open in a text from left to right.
        from bidi.algorithm import get_display

        # Not by PsychoPy's `languageStyle`, which takes the direction of each line from its first
        # letter: the second line of a text in Hebrew may begin with a Latin one.
        line = get_display(_reshaper().reshape(line), base_dir="R" if from_the_right else "L")
    return "".join(sign for sign in line if unicodedata.category(sign) != "Cf")


@cache
def _reshaper() -> Any:
    """Return what puts letters of Arabic into the forms in which they are joined."""
    from arabic_reshaper import ArabicReshaper

    # A whole word in one character, which many fonts lack.
    return ArabicReshaper({"ARABIC LIGATURE ALLAH": False})


def unshaped(text: str) -> str:
    """Return the characters of `text` that belong on or to others, and cannot be drawn there.

    >>> unshaped("कि"), unshaped("Tiếng Việt"), unshaped("سلام"), len(unshaped("👨‍👩‍👧"))
    ('ि', '', '', 1)
    """
    composed = unicodedata.normalize("NFC", text)
    return "".join(sorted({sign for sign in composed if _is_unshaped(sign)}))


def _is_unshaped(sign: str) -> bool:
    if unicodedata.category(sign).startswith("M"):
        return True
    name = unicodedata.name(sign, "")
    if name.startswith("ARABIC LETTER"):
        from arabic_reshaper.letters import LETTERS_ARABIC

        # Those of Arabic, Persian and Urdu, and forms that are joined already; others would stand
        # unjoined.
        return sign not in LETTERS_ARABIC and not unicodedata.decomposition(sign).startswith("<")
    return name.startswith(_JOINED)


def signs(texts: Iterable[str]) -> str:
    """Return each character that is drawn for `texts`, once."""
    lines = (line for text in texts for line in text.split("\n"))
    return "".join(sorted({sign for line in lines for sign in drawn(line) if sign != " "}))


def best_font(
    fonts: Iterable[str], has_sign: Callable[[str, str], bool], wanted: Collection[str]
) -> tuple[str, str] | None:
    """Return the first font with all `wanted` characters, else the first one and what it lacks.

    `fonts` are those installed; `has_sign` says whether a font has a character.
    """
    first: tuple[str, str] | None = None
    for font in fonts:
        lacking = "".join(sign for sign in wanted if not has_sign(font, sign))
        if not lacking:
            return font, ""
        first = first or (font, lacking)
    return first


MOST_NAMED = 5


def named(some: str) -> str:
    """Return the first of some characters with their names, so that they can be searched for.

    >>> named("é")
    "'é' (U+00E9 LATIN SMALL LETTER E WITH ACUTE)"
    """
    shown = [
        f"{sign!r} (U+{ord(sign):04X} {unicodedata.name(sign, 'without a name')})"
        for sign in some[:MOST_NAMED]
    ]
    more = [f"{len(some) - MOST_NAMED} more"] * (len(some) > MOST_NAMED)
    return ", ".join([*shown, *more])


NEEDS_SHAPING = "a text must have no characters that PsychoPy cannot place on, or join to, others"
WITHOUT_THEM = "write it without them, or use --ratings console"


def lacking_font(font: str, lacking: str, code: str) -> str:
    """Return what to say of a font that lacks characters of a language."""
    return f"the font {font} for the language {code} lacks {named(lacking)}; {font_remedy(code)}"


def font_remedy(code: str) -> str:
    return (
        "install a font that has them (Debian and Ubuntu: fonts-noto-core; for Chinese, Japanese "
        f"and Korean fonts-noto-cjk) and name it in `fonts` of texts/{code}.toml, or use --ratings "
        "console"
    )


# Fonts of this computer as fontconfig knows them, which needs no display. Where its command is
# missing, and on systems without it, the window itself looks when it opens.

_WITHIN_S = 10.0


@cache
def installed_font(family: str) -> frozenset[int] | None:
    """Return the code points of an installed font; None if it is not there or nobody can tell."""
    command = shutil.which("fc-match")
    if command is None:
        return None
    pattern = family.translate({ord(special): f"\\{special}" for special in r"\-:,="})
    try:
        listed = subprocess.run(
            [command, "-f", "%{family[0]}\n%{charset}", pattern],
            capture_output=True,
            text=True,
            encoding="utf-8",
            check=True,
            timeout=_WITHIN_S,
        ).stdout
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    name, _, ranges = listed.partition("\n")
    # Another font stands in for one that is missing.
    if name.casefold() != family.casefold():
        return None
    ends = [[int(end, 16) for end in span.split("-")] for span in ranges.split()]
    return frozenset(code for span in ends for code in range(span[0], span[-1] + 1))
