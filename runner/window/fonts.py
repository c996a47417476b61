"""The fonts that each language may be drawn in, best first."""

from collections.abc import Callable

from protocol.texts import Language

FONTS: dict[Language, tuple[str, ...]] = {
    "en": ("DejaVu Sans", "Arial", "Helvetica", "Liberation Sans"),
    "zh": (
        "WenQuanYi Micro Hei",
        "Noto Sans CJK JP",  # the face of the collection that can be loaded by its name
        "Microsoft YaHei",
        "PingFang SC",
    ),
}

PACKAGES: dict[Language, str] = {"en": "fonts-dejavu-core", "zh": "fonts-wqy-microhei"}
"""What brings the first font on Debian and Ubuntu."""


def missing(language: Language) -> str:
    """Return what to say when none of the language's fonts is there."""
    return (
        f"no font for the language {language} (looked for {', '.join(FONTS[language])}); "
        f"install {PACKAGES[language]}, or use --ratings console"
    )


def first_font(language: Language, there: Callable[[str], bool]) -> str | None:
    """Return the best font that is `there`, None if none is."""
    return next((name for name in FONTS[language] if there(name)), None)
