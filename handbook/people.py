"""The page of the parameters of virtual people, generated from their records."""

from dataclasses import fields

from device.people.person import DEFAULT, PARAMETERS, Distribution, Person
from handbook.meanings import meanings

_MEANINGS = meanings(Person)


def parameters_page() -> str:
    """Return the page: unit, limits, default, default population and meaning; sources.

    A population's cell is empty where all its people are as the one person. What has no source is
    assumed.
    """
    named: dict[str, list[str]] = {}
    for name, of in PARAMETERS.items():
        if source := of.source.removeprefix("assumed").lstrip(",;: "):
            named.setdefault(source, []).append(f"`{name}`")
    return "\n".join(
        [
            "# Parameters of virtual people",
            "",
            "This page is written from the program by `python -m handbook.reference`. Where "
            "*population* is\nempty, all its people are as the one person. What has no source "
            "below the table is assumed.",
            "",
            "| parameter | unit | from, to | one person | population | meaning |",
            "|---|---|---|---|---|---|",
            *map(_row, PARAMETERS),
            "",
            *(f"- {', '.join(names)}: {source}" for source, names in named.items()),
        ]
    )


def _row(name: str) -> str:
    of = PARAMETERS[name]
    varied, typical = DEFAULT.varied.get(name), getattr(DEFAULT.typical, name)
    shared = f"{getattr(Person(), name):g}"
    cells = [
        f"`{name}`",
        of.unit or "1",
        f"{of.low:g}, {of.high:g}",
        shared,
        _in_words(varied) if varied else "" if f"{typical:g}" == shared else f"{typical:g}",
        _MEANINGS[name],
    ]
    return f"| {' | '.join(cells)} |"


def _in_words(how: Distribution) -> str:
    """Return a distribution as a people file writes it."""
    given = [(entry.name.removesuffix("_of"), getattr(how, entry.name)) for entry in fields(how)]  # type: ignore[arg-type]
    shown = [
        f"{name} = {list(value) if isinstance(value, tuple) else f'{value:g}'}"
        for name, value in given
    ]
    return f"`{{ {', '.join(shown)} }}`"
