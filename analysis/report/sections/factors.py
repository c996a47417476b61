"""Effects of the study's factors, and of its sessions: main ones and interactions of two."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import partial

from analysis.estimates import Json, NotEstimable, or_null, plain
from analysis.report.as_json import unknown, with_reasons
from analysis.report.blocks import Cell, Column, Figure, Section, Table, estimate, p_cell
from analysis.report.figure_data import FactorMeans, factor_figure
from analysis.report.findings import Findings
from analysis.report.wording import number
from analysis.statistics.factorial import (
    SESSION,
    Effect,
    LatentFactorial,
    LatentLevel,
    LevelMean,
    TestedEffect,
    cell_intervals,
    factorial_tests,
)
from analysis.trials.trial_statistics import crossed_scores


def section(found: Findings) -> Section:
    """Return the effects, the means by level and a figure by factor; nothing without factors."""
    tests, title = found.trials.factorial, "Factors"
    if tests is None:
        return Section(name="factors", title=title, blocks=[])
    latent, readings = found.trials.latent_factorial, _readings(found)
    return Section(
        name="factors",
        title=title,
        blocks=[
            _effects(tests.effects, latent, readings),
            _model(latent),
            _levels(tests.levels, latent),
            *_figures(found),
        ],
        data={
            "factors": {
                "effects": [_effect_json(it) for it in tests.effects],
                "levels": [with_reasons(it, "difference_interval") for it in tests.levels],
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


def _readings(found: Findings) -> _Readings:
    """Return Holm's p of each effect under the other readings of withheld scores."""
    made = {}
    for name, table in list(found.table.tables.items())[1:]:
        crossed = crossed_scores(found.study, found.loaded, table)
        again = found.keep(factorial_tests, crossed[0]).effects if crossed else ()
        made[name] = {it.name: it.p_holm for it in again}
    return made


def _effects(effects: tuple[TestedEffect, ...], latent: _Latent, readings: _Readings) -> Table:
    words = {
        "zero": "Holm, withheld as lowest possible",
        "lowest": "Holm, withheld as lowest given",
    }
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
                Column(words[name], partial(_reread, again), p_cell)
                for name, again in readings.items()
            ),
        ],
        name="factor-effects",
        caption="Main effects and interactions of two factors within people. p, shuffled: the "
        "levels of these factors are shuffled within each person (exact where all arrangements "
        "could be listed); p, F: the same F, with Greenhouse and Geisser's correction. The larger "
        "one decides, corrected by Holm's method over this table. Partial η² with its 95% "
        "interval: share of an effect in what other effects and people's levels leave; general η²: "
        "its share in all but the other effects. Latent: Wald's test in the ordinal mixed model "
        "below, which an end of the scale does not bend; if people differ in an effect, its p is "
        "too small.",
    )


def _df(effect: Effect | NotEstimable) -> str:
    if isinstance(effect, NotEstimable):
        return effect.reason
    return f"{effect.df[0]}, {effect.df[1]}"


def _reread(again: Mapping[str, float | NotEstimable], it: TestedEffect) -> object:
    return again.get(it.name)


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
                Column(column.name, partial(_of_model, model, column))
                for column in estimate("latent", "effect")
                if known
            ),
        ],
        name="factor-levels",
        caption="Mean score by level, over the other factors; its difference from the mean of all "
        "levels, in points, and the same in the ordinal mixed model, in standard deviations of its "
        "latent residual, each with its 95% interval.",
    )


def _of_model(
    model: Mapping[tuple[str, str], LatentLevel], column: Column, it: LevelMean
) -> str | Cell:
    return column.cell(model[it.factor, it.level])


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
        means, halves = cell_intervals(of, *shown)
        data = FactorMeans(
            factors=tuple(shown),
            levels=tuple(of.factors[each] for each in shown),
            means=means.reshape(len(of.factors[name]), -1),
            halves=halves.reshape(len(of.factors[name]), -1),
            scale=found.scale,
        )
        by = f" and {beside}" * (len(shown) > 1)
        yield Figure(
            name=f"factor-{place}",
            title=f"Scores by {name}",
            caption=f"Mean scores by {name}{by}, over the other factors, with 95% intervals that "
            "leave out differences between people's levels (Cousineau and Morey).",
            draw=partial(factor_figure, data),
            keep=found.keep,
        )


def _effect_json(it: TestedEffect) -> Json:
    named = {"factors": list(it.factors), "p_holm": or_null(it.p_holm)}
    if isinstance(it.effect, NotEstimable):
        return {**named, **unknown(it.effect, *(each.name for each in fields(Effect)))}
    return {**named, "p": it.effect.p, **with_reasons(it.effect, "partial_eta2_interval")}
