"""Reference pages say what the code says."""

import pytest

from handbook.reference import FOLDER, PAGES


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_up_to_date(name: str) -> None:
    page = (FOLDER / name).read_text(encoding="utf-8")
    assert page == f"{PAGES[name]().rstrip()}\n", "run: python -m handbook.reference"
