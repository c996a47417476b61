"""What the words of answers mean, as `--answers` says it, and the column in which they stand."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from analysis.tables.roles import Roles
from analysis.tables.table_cells import Cells, TableError, is_missing
from protocol.errors import listed, typed_as

RIGHT = frozenset(
    {
        "true", "yes", "y", "t", "correct", "hit", "ja", "j", "richtig", "korrekt", "wahr",
        "oui", "vrai", "juste", "sí", "sì", "si", "correcto", "verdadero", "corretto", "giusto",
        "vero", "是", "对", "對", "正确", "正確",
    }
)  # fmt: skip
WRONG = frozenset(
    {
        "false", "no", "n", "f", "incorrect", "wrong", "miss", "nein", "falsch", "inkorrekt",
        "non", "faux", "incorrecto", "falso", "errato", "sbagliato", "否", "错", "錯", "错误",
        "錯誤",
    }
)  # fmt: skip
"""Words of answers in lower case. "Right" is none, because it may be a side."""


def told_meanings(answers: str | None, meanings: Sequence[str], example: str) -> dict[str, str]:
    """Return the meaning of each word of `--answers`, in lower case; a word may hold commas.

    >>> told_meanings("no=0,Yes, longer=1", ("1", "0"), "")
    {'no': '0', 'yes, longer': '1'}
    """
    pair = re.compile(rf"(.+?)\s*=\s*({'|'.join(meanings)})\s*(?:[,;]\s*|$)", re.IGNORECASE)
    told: dict[str, str] = {}
    rest = (answers or "").strip()
    while rest:
        if not (part := pair.match(rest)):
            raise TableError(f"--answers must be pairs such as {example}, got {rest[:40]!r}")
        told[part[1].casefold()] = part[2].casefold()
        rest = rest[part.end() :]
    return told


def with_answers(cells: Cells, roles: Roles, words: Mapping[str, str]) -> Roles:
    """Return the roles with the column of answers: known already, or the only one of these words.

    Raises:
        TableError: no column holds the words alone, or several do.
    """
    if not words or roles.column("answer") is not None:
        return roles
    taken = roles.told | {*roles.columns("subject", "score")}
    columns = {
        at: {row[at].casefold() for row in cells.rows if not is_missing(row[at])}
        for at in range(len(cells.header))
        if at not in taken
    }
    whole = [at for at, given in columns.items() if given and given <= words.keys()]
    if len(whole) == 1:
        return replace(roles, of={**roles.of, whole[0]: "answer"})
    some = whole or [at for at, given in columns.items() if given & words.keys()]
    raise TableError(f"{cells.source}: --answers: {_where(cells, some, words)}")


def _where(cells: Cells, columns: Sequence[int], words: Collection[str]) -> str:
    names = [cells.named(at) for at in columns]
    if not names:
        return (
            f"no column is the answer, and none holds {listed(words)}; write the words as they "
            "stand in the table, or add --columns answer=NAME"
        )
    also = [f"--columns {typed_as(f'answer={name}')}" for name in names]
    place = f"column{'s' * (len(names) > 1)} {listed(names)}"
    return f"no column is the answer; the words stand in {place}: add {' or '.join(also[:3])}"
