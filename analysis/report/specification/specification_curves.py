"""The study's claims under all choices of analysis, as specification curves."""

from functools import partial

from analysis.kept import Kept
from analysis.multiverse.curve import NAMES, Curve, Multiverse, PairTally
from analysis.multiverse.universes import Choice
from analysis.report.blocks import Block, Column, Figure, Items, Row, Section, Table, columns
from analysis.report.findings import Findings
from analysis.report.specification.specification_figure import specification_figure
from analysis.report.wording import count_of, number

MULTIVERSE = "multiverse"
"""Name of the section; it is made only if it is asked for by that name."""
_INTRODUCTION = (
    "An analysis makes choices that others might have made otherwise. Here each claim is judged in "
    "every combination of the choices that bear on it. An analysis supports a claim if its effect "
    "is the claimed one, whatever p. All analyses take the same data, so they are no independent "
    "tests."
)


def section(found: Findings) -> Section:
    """Return the claims under all choices; without them the names of the figures alone."""
    made = found.multiverse
    return Section(
        name=MULTIVERSE,
        title="Other choices of analysis",
        blocks=[Figure(name=_figure_name(name)) for name in NAMES]
        if made is None
        else _blocks(made, found.keep),
        data={} if made is None else {MULTIVERSE: made.as_json()},
    )


def _figure_name(claim: str) -> str:
    return f"{MULTIVERSE}-{claim}"


def _blocks(made: Multiverse, keep: Kept) -> list[Block]:
    alone = [f"{choice.capitalize()}: {why}." for choice, why in made.single.items()]
    return [
        _INTRODUCTION,
        Items(heading="Choices that make no difference in this study", lines=alone),
        Items(heading="Claims", lines=[in_words(curve) for curve in made.curves]),
        _pair_table(made.pairs) if any(pair.analyses > 1 for pair in made.pairs) else None,
        *(_figure(curve, keep) for curve in made.curves),
    ]


def in_words(curve: Curve) -> str:
    """Return in how many analyses a claim is supported, and which choice matters most."""
    tally, words = curve.tally, curve.claim.words
    if tally.analyses == 1:
        found = "supported" if tally.supported else "not supported"
        p = "p < .05" if tally.significant else "p ≥ .05"
        said = f"{words}: {found} by the only analysis ({p})"
    elif curve.claim.signed:
        beyond = f"p < .05 in {tally.significant:,}"
        said = f"{words} in {tally.supported:,} of {tally.analyses:,} analyses ({beyond})"
    else:
        said = f"{words} in {tally.significant} of {tally.analyses:,} analyses (p < .05)"
    unjudged = sum(curve.unjudged.values())
    beside = f" {count_of(unjudged, 'other')} cannot judge it.".capitalize() if unjudged else ""
    return f"{said}{_what_matters(curve)}.{beside}"


def _what_matters(curve: Curve) -> str:
    if curve.decides == Choice.EXCLUSIONS:
        return "; the exclusions decide"
    if curve.decides is not None:
        return f"; the {curve.decides} decides"
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
    rows: list[Row] = [
        [
            f"{pair.above} above {pair.below}",
            f"{pair.supported} of {pair.analyses}",
            str(pair.significant),
            f"{number(pair.least, 2)} to {number(pair.largest, 2)}",
        ]
        for pair in pairs
    ]
    return Table(
        name=f"{MULTIVERSE}-pairs",
        caption="Pairs of conditions in all analyses of the table: in how many the mean difference "
        "has this direction, in how many of them with p < .05 (signed rank, Holm's correction over "
        "all pairs), and the range of the mean differences, in points.",
        columns=[
            Column(name="pair", kind="text"),
            *columns("analyses", "p < .05", "mean difference"),
        ],
        rows=rows,
    )


def _figure(curve: Curve, keep: Kept) -> Figure:
    name = _figure_name(curve.claim.id)
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
        keep=keep,
        table=_option_table(name, curve),
    )


def _option_table(name: str, curve: Curve) -> Table:
    rows: list[Row] = [
        [
            f"{choice}: {option}",
            str(tally.analyses),
            str(tally.supported),
            str(tally.significant),
            number(tally.mean_effect, 2),
        ]
        for choice in curve.options
        for option, tally in curve.by_option(choice).items()
    ]
    return Table(
        name=name,
        caption=f"“{curve.claim.words}” by option: analyses, those that support the claim, those "
        f"with p < .05, and the mean effect ({curve.claim.effect}).",
        columns=[
            Column(name="option", kind="text"),
            *columns("analyses", "support", "p < .05", "mean effect"),
        ],
        rows=rows,
    )
