"""Lines of keys: every key that tomllib finds has one, and it is the right one."""

import tomllib
from collections.abc import Iterator
from typing import Any

import pytest

from protocol.errors import Path
from protocol.study_file.loading import TEMPLATES, template
from protocol.study_file.toml import key_lines, line_of

AWKWARD = """\
# comment
title = "a # no comment, \\" ] }"   # [not.a.table]
"quoted key" = 'it''s'
dotted.key."with = sign" = 1_000
text = \"\"\"
[not.a.table]
x = 1 \\\"\"\" \"\"\"\"
raw = '''
y = ['''
when = 1979-05-27T07:32:00Z
list = [ # first
  1,
  [2, "]"], { a = { b = 3 }, c = [4] },
]
[table.sub]
k = true
[[table.array]]
k = -inf
[table.array.deep]
k = 0x1F
[[table.array]]
k = 1.5
  [[table.array.inner]]
  k = []
"""


def paths(value: Any, above: Path = ()) -> Iterator[Path]:
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    for key, inner in items:
        yield (*above, key)
        yield from paths(inner, (*above, key))


@pytest.mark.parametrize("text", [AWKWARD.replace("'it''s'", "'its'"), *map(template, TEMPLATES)])
def test_every_key_has_the_line_that_names_it(text: str) -> None:
    lines = key_lines(text)
    written = text.splitlines()
    for path in paths(tomllib.loads(text)):
        assert path in lines, path
        if isinstance(path[-1], str):
            assert path[-1] in written[lines[path] - 1], path


def test_array_elements_are_told_apart() -> None:
    lines = key_lines(AWKWARD.replace("'it''s'", "'its'"))
    assert lines["table", "array", 1, "k"] == lines["table", "array", 0, "deep", "k"] + 2
    assert lines["table", "array", 1, "inner", 0, "k"] == AWKWARD.count("\n")
    assert lines["list", 1, 1] == lines["list", 0] + 1


def test_what_is_missing_stands_where_its_table_does() -> None:
    lines = key_lines("[rig]\na = 1\n")
    assert line_of(lines, ("rig", "b", 0)) == 1
    assert line_of(lines, ("touch",)) is None
