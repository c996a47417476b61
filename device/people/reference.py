"""The table of parameters in docs/people.md, written by `python -m device.people.reference`."""

from dataclasses import fields

from device.people.person import DEFAULT, PARAMETERS, Distribution, Person


def parameter_table() -> str:
    """Return the parameters with unit, limits, default, default population, meaning and source."""
    return "\n".join(
        [
            "| parameter | unit | from, to | one person | default population | meaning | source |",
            "|---|---|---|---|---|---|---|",
            *map(_row, PARAMETERS),
        ]
    )


def _row(name: str) -> str:
    of = PARAMETERS[name]
    varied, typical = DEFAULT.varied.get(name), getattr(DEFAULT.typical, name)
    cells = [
        f"`{name}`",
        of.unit or "1",
        f"{of.low:g}, {of.high:g}",
        f"{getattr(Person(), name):g}",
        f"{typical:g}" if varied is None else _in_words(varied),
        of.meaning,
        of.source,
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


if __name__ == "__main__":
    print(parameter_table())
