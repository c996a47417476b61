"""What the trials that open a session must be: a baseline without a signal, a signal with one."""

from collections.abc import Iterator

from protocol.problem import Problem
from protocol.study import Study


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
