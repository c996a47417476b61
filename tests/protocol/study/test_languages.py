"""The built-in languages: complete, and each in a file of its own."""

import json

import pytest

from protocol.study.languages import REFERENCE, built_in, built_in_codes
from protocol.study_file.loading import parsed_study, template, with_languages


def test_english_and_chinese_are_there_and_a_study_must_have_both() -> None:
    required = parsed_study(template("paper")).session.languages
    assert required == ("en", "zh")
    assert set(required) <= set(built_in_codes())


@pytest.mark.parametrize("code", built_in_codes())
def test_a_built_in_language_has_nothing_wrong(code: str) -> None:
    """Taken for a study's own, it is checked as one: keys, fields, answers, characters."""
    built = built_in(code)
    text = "\n".join(
        [
            f"name = {json.dumps(built.name)}",
            f"fonts = {json.dumps(list(built.fonts), ensure_ascii=False)}",
            "[texts]",
            *(f'"{key}" = {json.dumps(text)}' for key, text in built.texts.items()),
        ]
    )
    assert code in parsed_study(with_languages(template("paper"), {code: text})).languages


@pytest.mark.parametrize("code", built_in_codes())
def test_every_built_in_language_names_the_same_bands_in_the_same_order(code: str) -> None:
    english = built_in(REFERENCE)
    assert list(built_in(code).bands) == list(english.bands)
    assert list(built_in(code).texts) == list(english.texts)
    assert set(english.bands) == set(english.bands.values())
