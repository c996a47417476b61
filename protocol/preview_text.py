"""The preview of a plan as plain lines, for a terminal of 80 columns or more."""

from collections.abc import Iterator, Sequence

from protocol.precision import RESIDUAL_SD, Purchase
from protocol.preview import Predict, Preview, levels, minutes_buy
from protocol.trial import Trial


def preview_lines(shown: Preview, predict: Predict) -> Iterator[str]:
    """Yield the preview line by line: the first participant's trials, then the cohort."""
    yield f"Plan of the first of {len(shown.plans)} participants (session 1)"
    yield ""
    yield from _table(_trial_rows(shown, predict))
    yield ""
    yield from _session_lines(shown)
    yield ""
    yield from _carryover_lines(shown)
    yield ""
    yield from _purchase_lines(shown, predict)


def _trial_rows(shown: Preview, predict: Predict) -> Iterator[tuple[str, ...]]:
    yield ("#", "block", "kind", "condition", "amplitude V", "drive/f0", "predicted", "expected")
    for trial in shown.plans[0].trials:
        contrast = predict(trial)
        yield (
            str(trial.index),
            str(trial.block) if trial.block else "",
            "opposite" if trial.opposite else trial.kind.replace("trial", ""),
            trial.condition or "",
            _courses(trial, "voltage_v"),
            _courses(trial, "frequency"),
            "" if contrast is None else f"{contrast:+.3f}",
            trial.expected or "",
        )


def _courses(trial: Trial, key: str) -> str:
    """`100, 100`, or `0>200` where it changes during the touch."""
    return ", ".join(
        ">".join(f"{value:g}" for value in course) if isinstance(course, list) else f"{course:g}"
        for course in levels(trial.touches)[key]
    )


def _table(rows: Iterator[tuple[str, ...]]) -> Iterator[str]:
    cells = list(rows)
    widths = [max(len(row[place]) for row in cells) for place in range(len(cells[0]))]
    for row in cells:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()


def _session_lines(shown: Preview) -> Iterator[str]:
    rig, trials = shown.study.rig, shown.plans[0].trials
    touches = sum(len(trial.touches) for trial in trials)
    yield f"Session     {_span([s / 60 for s in shown.durations_s])} min, {touches} touches, " + (
        f"{sum(trial.scored for trial in trials)} scored trials, {_span(shown.swaps)} beam swaps"
    )
    yield f"Amplitude   {shown.max_voltage_v:g} V of {rig.max_voltage_v:g} V (peak)"
    yield f"Drive       {shown.max_frequency_hz:.0f} Hz of {rig.max_frequency_hz:g} Hz (nominal)"
    yield f"Slew        {shown.max_slew_v_per_us:.1f} V/us of {rig.max_slew_v_per_us:g} V/us"


def _span(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def _carryover_lines(shown: Preview) -> Iterator[str]:
    carryover, names = shown.carryover, shown.study.conditions
    if carryover.balanced:
        yield f"Carry-over  balanced over {len(shown.plans)} participants"
    else:
        yield (
            f"Carry-over  counts differ by up to {carryover.imbalance} over {len(shown.plans)} "
            f"participants; {_advice(shown)}"
        )
    header = ("after", *names)
    rows = [
        (name, *("" if a == b else str(count) for b, count in enumerate(row)))
        for a, (name, row) in enumerate(zip(names, carryover.counts, strict=True))
    ]
    yield from _table(iter([header, *rows]))


def _advice(shown: Preview) -> str:
    design, number = shown.study.design, len(shown.study.condition)
    if design.order != "williams" or design.group_by_beam != "no":
        return "this design does not balance them"
    return f"a multiple of {number if number % 2 == 0 else 2 * number} is balanced"


def _purchase_lines(shown: Preview, predict: Predict) -> Iterator[str]:
    yield "What the minutes buy: the 95 % interval of one person's sensitivity, from that person"
    yield f"alone (residual SD {RESIDUAL_SD:.2f} scores, as in the paper's Table 4), is g +/-"
    rows = [("repeats", "trials", "minutes", "scores per unit of contrast", "share of full scale")]
    rows += [_purchase_row(shown, bought) for bought in minutes_buy(shown, predict)]
    yield from _table(iter(rows))


def _purchase_row(shown: Preview, bought: Purchase) -> tuple[str, str, str, str, str]:
    here = " <" if bought.repeats == shown.study.design.repeats else ""
    known = bought.half_width < float("inf")
    return (
        f"{bought.repeats}{here}",
        str(bought.trials),
        f"{bought.duration_s / 60:.1f}",
        f"{bought.half_width:.2f}" if known else "not determined",
        f"{bought.relative:.0%}" if known else "",
    )
