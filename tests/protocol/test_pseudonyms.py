"""The rule for pseudonyms."""

import pytest

from protocol.errors import BadInput
from protocol.pseudonyms import pseudonym


@pytest.mark.parametrize("text", ["P01", "1", "p-1_b", "COM10", "com1x", "NUL1", "7" * 32])
def test_pseudonyms(text: str) -> None:
    assert pseudonym(text) == text


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            "Anna",
            "-1",
            "_1",
            "P 1",
            "P01\n",
            "../P1",
            "=1",
            "P01/1",
            "Р01",
            "P\u0661",
            "7" * 33,
        ),
        *("COM1", "com9", "LPT0", "Lpt1"),
    ],
)
def test_nothing_else_is_one(text: str) -> None:
    with pytest.raises(BadInput, match="a participant must be a pseudonym of at most 32 letters"):
        pseudonym(text)
