"""Effects of factors and sessions: main ones and interactions of two."""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from functools import partial

from analysis.estimates import Json, NotEstimable, or_null, plain
from analysis.report import figure_data
from analysis.report.blocks import Column, Figure, Section, Table, estimate, p_cell
from analysis.report.estimates_json import unknown, with_reasons
from analysis.report.findings import Findings
from analysis.report.wording import READ_AS, number
from analysis.statistics.factorial import (
    SESSION,
    Effect,
    LatentFactorial,
    LevelMean,
    TestedEffect,
    cell_intervals,
)

# Six factors of the file, its conditions, and the sessions.
FIGURES = tuple(f"factor-{number}" for number in range(1, 9))


def section(found: Findings) -> Section:
    """Return the effects, the means by level and a figure by factor; nothing without factors."""
    tests = found.factors
    if tests is None:
        return Section()
    latent = found.trials.latent_factorial
    readings = {
        name: {it.name: it.p_holm for it in (of.factors.effects if of.factors else ())}
        for name, of in found.reread()
    }
    return Section(
        title="Factors",
        blocks=[
            _effects(tests.effects, latent, readings),
            _model(latent),
            _levels(tests.levels, latent),
            *_figures(found),
        ],
        data={
            "factors": {
                "effects": [_effect_json(it) for it in tests.effects],
                "levels": [with_reasons(it) for it in tests.levels],
                "latent": plain(latent),
                "p_holm_by_reading": {
                    name: {effect: or_null(p) for effect, p in again.items()}
                    for name, again in readings.items()
                },
            }
        },
    )


_Latent = LatentFactorial | NotEstimable | None
_Readings = dict[str, dict[str, float | NotEstimable]]


def _effects(effects: tuple[TestedEffect, ...], latent: _Latent, readings: _Readings) -> Table:
    wald = {it.factors: it for it in latent.effects} if isinstance(latent, LatentFactorial) else {}
    return Table.over(
        effects,
        [
            Column("effect", "name", kind="text"),
            Column("people", "effect.people"),
            Column("F", "effect.f", 2),
            Column("df", "effect", _df),
            Column("p, shuffled", "effect.p_permuted", p_cell),
            Column("p, F", "effect.p_f", p_cell),
            Column("p, Holm", "p_holm", p_cell),
            *estimate("partial η²", "effect.partial_eta2"),
            Column("general η²", "effect.generalized_eta2", 2),
            *[Column("latent p", lambda it: wald[it.factors].p, p_cell)] * bool(wald),
            *(
                Column(
                    f"Holm, {READ_AS[name]}", partial(lambda of, it: of.get(it.name), again), p_cell
                )
                for name, again in readings.items()
            ),
        ],
        name="factor-effects",
        caption="Main effects and interactions of two factors within people. p, shuffled: the "
        "levels of these factors are shuffled within each person (exact where all arrangements "
        "could be listed); p, F: the same F, with Greenhouse and Geisser's correction. The larger "
        "one decides, corrected by Holm's method over all questions of this page. Partial η² with "
        "its 95% interval: share of an effect in what other effects and people's levels leave; "
        "general η²: its share in all but the other effects. Latent: Wald's test in the ordinal "
        "mixed model below, which an end of the scale does not bend; if people differ in an "
        "effect, its p is too small.",
    )


def _df(effect: Effect | NotEstimable) -> str:
    if isinstance(effect, NotEstimable):
        return effect.reason
    return f"{effect.df[0]}, {effect.df[1]}"


def _model(latent: _Latent) -> str:
    if not isinstance(latent, LatentFactorial):
        why = latent.reason if latent else ""
        return f"Ordinal mixed model of the factors: not estimable ({why})."
    cells = (
        "" if latent.cell_sd is None else f", between a subject's cells {number(latent.cell_sd)}"
    )
    return (
        "Ordinal mixed model of the factors (cumulative probit; main effects and interactions of "
        f"two): between-subject standard deviation {number(latent.subject_sd)}{cells}, in standard "
        "deviations of the latent residual."
    )


def _levels(levels: Sequence[LevelMean], latent: _Latent) -> Table:
    known = latent.levels if isinstance(latent, LatentFactorial) else ()
    model = {(it.factor, it.level): it for it in known}
    return Table.over(
        levels,
        [
            Column("factor", "factor", kind="text"),
            Column("level", "level", kind="text"),
            Column("mean", "mean", 2),
            *estimate("difference", "difference"),
            *(
                Column(own.name, partial(lambda own, it: own.cell(model[it.factor, it.level]), own))
                for own in estimate("latent", "effect")
                if known
            ),
        ],
        name="factor-levels",
        caption="Mean score by level, over the other factors; its difference from the mean of all "
        "levels, in points, and the same in the ordinal mixed model, in standard deviations of its "
        "latent residual, each with its 95% interval.",
    )


def _figures(found: Findings) -> Iterator[Figure]:
    """Yield a figure for each factor, with a line for each level of the next one."""
    crossed, wide = found.trials.crossed or (None, None)
    every = wide or crossed
    names = list(every.factors) if every else []
    for place, name in enumerate(names, start=1):
        beside = names[place % len(names)]
        shown = [name] if beside == name else [name, beside]
        of = every if crossed is None or SESSION in shown else crossed
        if of is None or len(of.complete) < 2:
            continue
        factors, levels = {each: of.factors[each] for each in shown}, len(of.factors[name])
        means, halves = (each.reshape(levels, -1) for each in cell_intervals(of, *shown))
        by = f" and {beside}" * (len(shown) > 1)
        yield Figure(
            name=f"factor-{place}",
            title=f"Scores by {name}",
            caption=f"Mean scores by {name}{by}, over the other factors, with 95% intervals that "
            "leave out differences between people's levels (Cousineau and Morey).",
            draw=partial(figure_data.factor_figure, factors, means, halves, found.scale),
        )


def _effect_json(it: TestedEffect) -> Json:
    named = {"factors": list(it.factors), "p_holm": or_null(it.p_holm)}
    if isinstance(it.effect, NotEstimable):
        return {**named, **unknown(it.effect, *(each.name for each in fields(Effect)))}
    return {**named, "p": it.effect.p, **with_reasons(it.effect)}
