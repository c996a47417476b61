"""What the report's page shows, section by section; the template says how it looks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from analysis.estimates import NotEstimable
from analysis.loading.missing_scores import withheld
from analysis.loading.study_data import Loaded
from analysis.report.illustrations import Illustration
from analysis.report.methods import laws_line
from analysis.report.table4_text import table4_lines
from analysis.report.tables import (
    PageTable,
    catch_table,
    condition_table,
    detection_table,
    differs,
    icc_table,
    law_table,
    listing,
    pairwise_table,
    prediction_table,
    readings_table,
    subject_table,
)
from analysis.report.trials import subject_trials, table4_cells, trial_header
from analysis.report.wording import (
    MISSING,
    catch_line,
    drift_line,
    f_line,
    number,
    omnibus_line,
    p_value,
    share,
)
from analysis.statistics.summary import TableStatistics
from analysis.trials.trial_statistics import TrialStatistics
from protocol.study.fields import printable

Tables = Mapping[str, PageTable | None]


def tables(loaded: Loaded, table: TableStatistics, trials: TrialStatistics) -> Tables:
    """Return the page's tables by name, None for one that has nothing to show."""
    m3 = trials.m3
    repeated = len(table.readings) > 1 and bool(withheld(loaded.table, loaded.empty).any())
    return {
        "readings": readings_table(table.readings) if repeated else None,
        "pairwise": pairwise_table(table.main.pairwise) if table.main.pairwise else None,
        "icc": icc_table(table),
        "conditions": condition_table(loaded.table, table, trials.ordinal),
        "subjects": subject_table(table),
        "predictions": prediction_table(loaded.table, trials.laws),
        "laws": law_table(trials.laws),
        "detection": None if isinstance(m3, NotEstimable) else detection_table(m3),
        "catch": catch_table(trials.catch) if trials.catch.subjects else None,
        "left_out": listing(
            "left-out",
            "What is left out of every number of this report, and why.",
            ["participant", "session", "trial", "by", "why"],
            (
                [e.participant, _or_all(e.session), _or_all(e.trial), e.by, e.why]
                for e in loaded.left_out
            ),
        ),
        "incidents": listing(
            "incidents",
            "Interruptions, and what the operator noted.",
            ["participant", "session", "trial", "what", "in words"],
            (
                [e.participant, str(e.session), _or_none(e.trial), e.what, e.text]
                for e in loaded.incidents
            ),
        ),
    }


def _or_all(value: int | None) -> str:
    return "all" if value is None else str(value)


def _or_none(value: int | None) -> str:
    return MISSING if value is None else str(value)


def sentences(loaded: Loaded, table: TableStatistics, trials: TrialStatistics) -> dict[str, str]:
    """Return the sentences that stand between the tables, by name; an empty one has no place."""
    return {
        "omnibus": omnibus_line(table.main),
        "pairs": _pairs_line(table),
        "additive": _additive_line(table),
        "ordinal": _ordinal_line(trials),
        "signal": _signal_line(trials),
        "laws": laws_line(trials),
        "drift": drift_line(trials.drift),
        "order": f_line("Place in the session", trials.order),
        "carry_over": f_line("Carry-over from the trial before", trials.carry_over),
        "catch": catch_line(trials.catch.overall),
        "unfinished": _unfinished_line(loaded),
        "interruptions": _interruptions_line(loaded),
    }


def _unfinished_line(loaded: Loaded) -> str:
    if loaded.kinds == ("published",):
        return "not known of a published table"
    return ", ".join(loaded.unfinished) or "none"


def _interruptions_line(loaded: Loaded) -> str:
    """Say that nothing interrupted the sessions where that is known and so."""
    if loaded.kinds == ("published",):
        return "What interrupted the sessions behind a published table is not known."
    if loaded.incidents:
        return ""
    if loaded.unfinished:
        return "No other incident was recorded."
    return "No session was interrupted, and nothing was noted."


def _pairs_line(table: TableStatistics) -> str:
    found = [f"{pair.a} and {pair.b}" for pair in table.main.pairwise if differs(pair)]
    if all(isinstance(pair.test, NotEstimable) for pair in table.main.pairwise):
        return "No pair of conditions can be tested."
    if not found:
        return "No pair of conditions differs after Holm's correction."
    return f"After Holm's correction differ: {', '.join(found)}."


def _additive_line(table: TableStatistics) -> str:
    effects, gains = table.additive, table.heterogeneity
    if isinstance(effects, NotEstimable):
        return f"Additive effects: none ({effects.reason})."
    slopes = (
        f"none ({gains.reason})"
        if isinstance(gains, NotEstimable)
        else f"F({gains.df[0]}, {gains.df[1]}) = {gains.f:.3f}, p = {p_value(gains.p)}, "
        f"moment estimate of their spread τ = {number(gains.tau)}"
    )
    return (
        f"Score = {number(effects.grand_mean)} + condition + subject + residual: residual standard "
        f"deviation {number(effects.residual_sd)} ({effects.residual_df} df), of subjects "
        f"{number(effects.subject_sd)}, shrinkage {number(effects.shrinkage)}. Do subjects differ "
        f"in how strongly conditions show (gain heterogeneity)? {slopes}."
    )


def _ordinal_line(trials: TrialStatistics) -> str:
    said = [
        f"{link}: none ({found.reason})"
        if isinstance(found, NotEstimable)
        else f"{link}: standard deviation of subjects {number(found.subject_sd)}, "
        f"log-likelihood {number(found.log_likelihood, 4)}"
        for link, found in trials.ordinal.items()
    ]
    return f"Ordinal mixed model, {'; '.join(said)}."


def _signal_line(trials: TrialStatistics) -> str:
    signal = trials.signal
    laws = ", ".join(f"{law} {number(value, 4)}" for law, value in signal.predicted.items())
    felt = (
        "is not recorded here"
        if isinstance(signal.felt, NotEstimable)
        else f"was felt as expected by {share(signal.felt)}"
    )
    return f"The first signal (0 → 100 V) {felt}; contrast predicted for it: {laws}."


@dataclass(frozen=True, kw_only=True)
class Page:
    """All that the template needs, in the order of the page."""

    title: str
    rehearsals: bool
    changed: str
    loaded: Loaded
    table: TableStatistics
    table_notes: Sequence[str]
    trials: TrialStatistics
    illustrations: Mapping[str, Illustration]
    no_sensitivity: Sequence[str]
    left_out: Mapping[str, int]
    rules: Sequence[str]
    methods: Sequence[str]
    limits: Sequence[str]
    provenance: Mapping[str, str]
    records: Sequence[Mapping[str, Any]]


def _printable(value: object) -> object:
    """A text without what would make a browser show something else; markup stays markup."""
    return type(value)(printable(value)) if isinstance(value, str) else value


def page_html(page: Page) -> str:
    """Return the page: one file that needs no network. Every text in it is escaped."""
    from jinja2 import Environment

    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, finalize=_printable
    )
    source = (files("analysis.report") / "report.html").read_text(encoding="utf-8")
    main = page.table.main.table4
    trials = subject_trials(main, page.records)
    return environment.from_string(source).render(
        page=page,
        missing=MISSING,
        header=table4_lines(main, MISSING)[0],
        table4=table4_cells(main, trials, page.loaded.empty),
        tables=tables(page.loaded, page.table, page.trials),
        said=sentences(page.loaded, page.table, page.trials),
        trial_header=trial_header(tuple(page.trials.contrasts.by_law)),
        trials=trials,
    )
