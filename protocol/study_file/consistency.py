"""Consistency of a study's names, of its opening trials and of its practice."""

from collections.abc import Iterator, Sequence

from protocol.errors import Path, Problem
from protocol.study.study import Study

_Named = tuple[Path, str]


def name_problems(study: Study) -> Iterator[Problem]:
    """Yield every name of the study, a condition or a beam that is blank or like another one."""
    yield from _blank("study", [(("study", "name"), study.study.name)])
    conditions: list[_Named] = [
        (("condition", number, "name"), name) for number, name in enumerate(study.conditions)
    ]
    beams: list[_Named] = [(("beams", name), name) for name in study.beams]
    for where, named in (("condition", conditions), ("beams", beams)):
        yield from _blank(where, named)
        yield from _alike(where, named)


def _blank(where: str, named: Sequence[_Named]) -> Iterator[Problem]:
    for path, name in named:
        if not any(character.isprintable() and character != " " for character in name):
            yield Problem(
                where=where,
                rule="a name must not be blank",
                value=repr(name),
                hint="give it one that can be read in a table",
                path=path,
            )


def _alike(where: str, named: Sequence[_Named]) -> Iterator[Problem]:
    seen: dict[str, _Named] = {}
    for path, name in named:
        remembered = " ".join(name.casefold().split())
        before, first = seen.setdefault(remembered, (path, name))
        if before != path:
            same = first == name
            yield Problem(
                where=where,
                rule="names must differ" + ("" if same else " by more than case and spaces"),
                value=repr(name) if same else f"{name!r} beside {first!r}",
                hint="rename one",
                path=path,
            )


def opening_problems(study: Study) -> Iterator[Problem]:
    """Yield every baseline that is driven, and every signal that never is."""
    for number, opening in enumerate(study.opening):
        driven = [touch.peak_voltage_v > 0 for touch in opening.touches]
        path = ("opening", number, "touches")
        if opening.kind == "signal" and not any(driven):
            yield Problem(
                where="opening signal",
                rule="a signal must be driven in at least one touch",
                value="0 V throughout",
                hint='give its touches a voltage_v, or write kind = "baseline"',
                path=path,
            )
        if opening.kind == "baseline":
            for place, touch in enumerate(opening.touches):
                if driven[place]:
                    yield Problem(
                        where=f"opening baseline, touch {place + 1}",
                        rule="a baseline must be without a signal",
                        value=f"{touch.peak_voltage_v:g} V",
                        hint='write voltage_v = 0, or kind = "signal"',
                        path=(*path, place, "ramp_to_v" if not touch.voltage_v else "voltage_v"),
                    )


def practice_problems(study: Study) -> Iterator[Problem]:
    """Yield a demand on practice in a study without practice, where it would never be made."""
    wanted = study.as_instructed.practise_until
    if wanted and not study.design.practice_trials:
        yield Problem(
            where="design.practice_trials",
            rule=f"must be above 0 where as_instructed.practise_until = {wanted}",
            value="0",
            hint="give practice_trials, or leave practise_until out",
            path=("design", "practice_trials"),
        )
