"""The report of a study: Table 4 and all that follows, as page, tables, figures and data."""

import json
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any

from analysis.cells import json_text
from analysis.estimates import NotEstimable
from analysis.loading.exclusions import rules_in_words
from analysis.loading.missing_scores import notes, withheld
from analysis.loading.study_data import Loaded, changed_journal
from analysis.report.as_json import (
    empty_json,
    left_out_json,
    plain,
    statistics_json,
    table4_json,
    trial_statistics_json,
    trials_json,
)
from analysis.report.illustrations import FIGURES, Illustration, illustrations
from analysis.report.methods import limits, methods
from analysis.report.page import Page, page_html
from analysis.report.provenance import Origin, provenance
from analysis.report.table4_text import table4_csv, table4_tex
from analysis.statistics.summary import TableStatistics, table_statistics
from analysis.trials.trial_statistics import TrialStatistics, trial_statistics
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True, eq=False)
class Report:
    """Everything that is reported of one study."""

    title: str
    loaded: Loaded
    study: Study
    origin: Origin
    table: TableStatistics
    trials: TrialStatistics

    @cached_property
    def trial_records(self) -> list[dict[str, Any]]:
        """A record per trial that counts, with its predictions."""
        return trials_json(self.loaded.rows, self.trials.contrasts)

    @cached_property
    def illustrations(self) -> dict[str, Illustration]:
        """The figures by name."""
        return illustrations(self.loaded, self.table, self.trials)

    @cached_property
    def provenance(self) -> dict[str, str]:
        """What the report was made from, name by name."""
        digest = sha256(json.dumps(self.trial_records, ensure_ascii=False).encode()).hexdigest()
        return provenance(self.origin, self.loaded, self.study, digest)

    @cached_property
    def table_notes(self) -> list[str]:
        """What stands under Table 4."""
        return notes(self.loaded.table, self.loaded.empty)

    @property
    def rehearsals(self) -> bool:
        """Whether any of the scores come from a rehearsal."""
        return "rehearsal" in self.loaded.kinds


def report(title: str, loaded: Loaded, study: Study, origin: Origin) -> Report:
    """Return the report on what was `loaded` of `study`."""
    return Report(
        title=title,
        loaded=loaded,
        study=study,
        origin=origin,
        table=table_statistics(loaded.table, withheld(loaded.table, loaded.empty)),
        trials=trial_statistics(loaded, study),
    )


def report_json(result: Report) -> dict[str, Any]:
    """Return every number of the report; `null` where there is none, with the reason beside it."""
    loaded = result.loaded
    return {
        "title": result.title,
        "kinds": list(loaded.kinds),
        "rehearsals": result.rehearsals,
        "broken_chains": list(result.origin.broken_chains),
        "unfinished": list(loaded.unfinished),
        "left_out": left_out_json(loaded),
        "exclusions": plain(loaded.left_out),
        "incidents": plain(loaded.incidents),
        "table4": {**table4_json(result.table.main.table4), **empty_json(loaded)},
        **statistics_json(result.table, loaded.table),
        **trial_statistics_json(result.trials),
        "trials": result.trial_records,
        "provenance": result.provenance,
    }


def report_html(result: Report) -> str:
    """Return the report as one page that needs no network."""
    broken = result.origin.broken_chains
    return page_html(
        Page(
            title=result.title,
            rehearsals=result.rehearsals,
            changed=changed_journal(broken) if broken else "",
            loaded=result.loaded,
            table=result.table,
            table_notes=result.table_notes,
            trials=result.trials,
            illustrations=result.illustrations,
            no_sensitivity=[
                f"{model} has no answer: {found.reason}."
                for model, found in (("M1", result.trials.m1), ("M2", result.trials.m2))
                if isinstance(found, NotEstimable)
            ],
            left_out=left_out_json(result.loaded),
            rules=rules_in_words(result.study.exclusions),
            methods=methods(result.loaded, result.study, result.trials),
            limits=limits(result.loaded, result.trials),
            provenance=result.provenance,
            records=result.trial_records,
        )
    )


def report_files(result: Report) -> dict[str, bytes]:
    """Return page, tables, data and figures by relative path."""
    return {
        "table4.csv": table4_csv(result.table.main.table4).encode(),
        "table4.tex": table4_tex(result.table.main.table4).encode(),
        "report.html": report_html(result).encode(),
        "report.json": json_text(report_json(result)).encode(),
        **_figures(result),
    }


FIGURE_FILES = tuple(f"figures/{name}.{kind}" for name in FIGURES for kind in ("svg", "png"))
"""All figures that a report may have."""


def _figures(result: Report) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    for name, shown in result.illustrations.items():
        found[f"figures/{name}.svg"] = shown.drawing.svg.encode()
        found[f"figures/{name}.png"] = shown.drawing.png
    return found
