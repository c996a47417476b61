"""The study's claims under all choices of analysis, as specification curves."""

from functools import partial
from textwrap import fill
from types import SimpleNamespace

import numpy as np

from analysis.multiverse.curve import NAMES, Curve, PairTally
from analysis.multiverse.universes import Choice
from analysis.report import drawing as plot
from analysis.report.blocks import Column, Figure, Items, Section, Table
from analysis.report.findings import Findings
from analysis.report.wording import count_of, number, sentence

# Specification curve: the effects of all analyses in order, and the choices of each below.

_ROW_IN = 0.19
_ABOVE_IN = 2.4
_MOST_INTERVALS = 100
"""Error bars of more analyses than these would cover each other."""


def specification_figure(data: Curve, sheet: plot.Sheet) -> None:
    """Draw the effects of a claim's analyses above, and a matrix of their choices below."""
    rows = [line for choice, options in data.options.items() for line in (choice, *options)]
    heights = _ABOVE_IN, _ROW_IN * (len(rows) + 1)
    above, below = sheet.grid(2, 1, sum(heights), heights)
    _effects(above, data)
    _choices(below, data)
    if data.own is not None:
        for axes in (above, below):
            axes.axvline(data.own + 1, color=plot.GREY, linestyle=":", zorder=0)


def _effects(axes: plot.Axes, data: Curve) -> None:
    places = np.arange(1, len(data.judged) + 1)
    effects = np.array([it.effect for it in data.judged])
    significant = np.array([it.significant for it in data.judged])
    supported = np.array([data.claim.supported(it) for it in data.judged])
    ends = np.array([it.interval or (np.nan, np.nan) for it in data.judged])
    if len(places) <= _MOST_INTERVALS:
        errors = np.abs(ends.T - effects)
        axes.errorbar(places, effects, yerr=errors, fmt="none", ecolor=plot.GREY, elinewidth=0.8)
    # Smaller markers where there are many, so that they do not hide each other.
    size = min(plot.marker(1.0), plot.marker(60 / len(places)))
    kinds = {
        "supported, p < .05": (significant, "o", plot.COLOURS[0], plot.COLOURS[0]),
        "supported, p ≥ .05": (supported & ~significant, "o", plot.COLOURS[0], "white"),
        "not supported": (~supported, "s", plot.COLOURS[1], plot.COLOURS[1]),
    }
    for label, (chosen, shape, colour, face) in kinds.items():
        if chosen.any():
            axes.plot(
                places[chosen],
                effects[chosen],
                shape,
                label=label,
                color=colour,
                markerfacecolor=face,
                markersize=size,
            )
    if data.claim.signed:
        axes.axhline(0, color="black", linewidth=0.6)
    axes.set_ylabel(fill(data.claim.effect, 24), fontsize="small")
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=3,
        frameon=False,
        fontsize="small",
        borderpad=0,
        handletextpad=0.2,
        columnspacing=1.0,
    )
    axes.tick_params(axis="x", labelbottom=False)


def _choices(axes: plot.Axes, data: Curve) -> None:
    labels: list[str] = []
    headings: list[int] = []
    size = min(plot.marker(0.8), plot.marker(50 / len(data.judged)))
    for choice, options in data.options.items():
        headings.append(len(labels))
        labels.append(choice)
        for option in options:
            taken = [place for place, it in enumerate(data.chosen, 1) if it.get(choice) == option]
            axes.plot(taken, [len(labels)] * len(taken), "s", color="black", markersize=size)
            labels.append(option)
    axes.set_yticks(range(len(labels)), labels, fontsize="small")
    for place in headings:
        axes.get_yticklabels()[place].set_fontweight("bold")
    axes.tick_params(axis="y", length=0)
    # Turned round, so that the choices read from top to bottom.
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlabel("analyses, by effect")
    axes.locator_params(axis="x", integer=True)


MULTIVERSE = "multiverse"
"""Name of the section; it is made only if it is asked for by that name."""
FIGURES = tuple(f"{MULTIVERSE}-{claim}" for claim in NAMES)
_INTRODUCTION = (
    "An analysis makes choices that others might have made otherwise. Here each claim is judged in "
    "every combination of the choices that bear on it. An analysis supports a claim if its effect "
    "is the claimed one, whatever p. All analyses take the same data, so they are no independent "
    "tests."
)


def section(found: Findings) -> Section:
    """Return the claims under all choices; nothing where they were not asked for."""
    made = found.multiverse
    if made is None:
        return Section()
    alone = [f"{choice.capitalize()}: {why}." for choice, why in made.single.items()]
    return Section(
        title="Other choices of analysis",
        blocks=[
            _INTRODUCTION,
            Items(heading="Choices that make no difference in this study", lines=alone),
            Items(heading="Claims", lines=[in_words(curve) for curve in made.curves]),
            _pair_table(made.pairs) if any(pair.analyses > 1 for pair in made.pairs) else None,
            *map(_figure, made.curves),
        ],
        data={MULTIVERSE: made.as_json()},
    )


def in_words(curve: Curve) -> str:
    """Return in how many analyses a claim is supported, and which choice matters most."""
    tally, words = curve.tally, curve.claim.words
    if tally.analyses == 1:
        found, sign = "not " * (not tally.supported), "<" if tally.significant else "≥"
        said = f"{words}: {found}supported by the only analysis (p {sign} .05)"
    elif curve.claim.signed:
        beyond = f"p < .05 in {tally.significant:,}"
        said = f"{words} in {tally.supported:,} of {tally.analyses:,} analyses ({beyond})"
    else:
        said = f"{words} in {tally.significant} of {tally.analyses:,} analyses (p < .05)"
    unjudged = sum(curve.unjudged.values())
    beside = f" {sentence(count_of(unjudged, 'other'))} cannot judge it." if unjudged else ""
    return f"{said}{_what_matters(curve)}.{beside}"


def _what_matters(curve: Curve) -> str:
    if (choice := curve.decides) is not None:
        return f"; the {choice} {'decide' if choice == Choice.EXCLUSIONS else 'decides'}"
    choice = curve.moves_most
    if choice is None:
        return "" if curve.tally.analyses == 1 else "; no choice moves the effect"
    means = {option: it.mean_effect for option, it in curve.by_option(choice).items()}
    low, high = (pick(means, key=lambda it: means[it]) for pick in (min, max))
    moves = "move" if choice == Choice.EXCLUSIONS else "moves"
    return (
        f"; the {choice} {moves} the effect most, on average from {number(means[low], 2)} ({low}) "
        f"to {number(means[high], 2)} ({high})"
    )


def _pair_table(pairs: tuple[PairTally, ...]) -> Table:
    return Table.over(
        pairs,
        [
            Column("pair", lambda pair: f"{pair.above} above {pair.below}", kind="text"),
            Column("analyses", lambda pair: f"{pair.supported} of {pair.analyses}"),
            Column("p < .05", "significant"),
            Column(
                "mean difference",
                lambda pair: f"{number(pair.least, 2)} to {number(pair.largest, 2)}",
            ),
        ],
        name=f"{MULTIVERSE}-pairs",
        caption="Pairs of conditions in all analyses of the table: in how many the mean difference "
        "has this direction, in how many of them with p < .05 (signed rank, Holm's correction over "
        "all pairs), and the range of the mean differences, in points.",
    )


def _figure(curve: Curve) -> Figure:
    name = f"{MULTIVERSE}-{curve.claim.id}"
    if not curve.options:
        return Figure(name=name)
    own = " The dotted line marks this report's own analysis." if curve.own is not None else ""
    bars = " Bars: 95% intervals." if any(it.interval for it in curve.judged) else ""
    return Figure(
        name=name,
        title=f"Specification curve: {curve.claim.words}",
        caption=f"“{curve.claim.words}” in {curve.tally.analyses:,} analyses, from the smallest "
        f"effect to the largest. Above: {curve.claim.effect}.{bars} Below: squares mark the "
        f"options that each analysis took.{own}",
        draw=partial(specification_figure, curve),
        table=_option_table(name, curve),
    )


def _option_table(name: str, curve: Curve) -> Table:
    return Table.over(
        [
            SimpleNamespace(option=f"{choice}: {option}", tally=tally)
            for choice in curve.options
            for option, tally in curve.by_option(choice).items()
        ],
        [
            Column("option", "option", kind="text"),
            Column("analyses", "tally.analyses"),
            Column("support", "tally.supported"),
            Column("p < .05", "tally.significant"),
            Column("mean effect", "tally.mean_effect", 2),
        ],
        name=name,
        caption=f"“{curve.claim.words}” by option: analyses, those that support the claim, those "
        f"with p < .05, and the mean effect ({curve.claim.effect}).",
    )
