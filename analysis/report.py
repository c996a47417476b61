"""The report of a study: Table 4, its test, a figure; as HTML, CSV and JSON."""

import json
import math
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

from analysis.figures import scores_figure
from analysis.no_answer import NoAnswer
from analysis.session_scores import Loaded
from analysis.statistics.friedman import Friedman, friedman
from analysis.table4 import Table4, table4, table4_csv

MISSING_ON_PAGE = "–"


@dataclass(frozen=True, kw_only=True)
class Report:
    """Everything that is reported of one study."""

    title: str
    loaded: Loaded
    table4: Table4
    friedman: Friedman | NoAnswer

    @property
    def rehearsals(self) -> bool:
        """Whether any of the scores come from a rehearsal."""
        return "rehearsal" in self.loaded.kinds


def report(title: str, loaded: Loaded) -> Report:
    """Return the report on what was `loaded`."""
    return Report(
        title=title,
        loaded=loaded,
        table4=table4(loaded.table),
        friedman=friedman(loaded.table),
    )


def report_json(result: Report) -> dict[str, Any]:
    """Return every number of the report; `null` where there is none, with the reason beside it."""
    table = result.table4
    return {
        "title": result.title,
        "kinds": list(result.loaded.kinds),
        "unfinished": list(result.loaded.unfinished),
        "left_out": left_out(result.loaded),
        "table4": {
            "columns": list(table.table.conditions),
            "rows": [
                {
                    "subject": subject,
                    "scores": [_number(score) for score in scores],
                    "comprehensive": _number(mean),
                }
                for subject, scores, mean in zip(
                    table.table.subjects, table.table.scores, table.row_means, strict=True
                )
            ],
            "column_means": {
                name: _number(mean)
                for name, mean in zip(table.table.conditions, table.column_means, strict=True)
            },
            "grand_mean": _number(table.grand_mean),
            "missing": table.table.missing_count,
        },
        "friedman": _friedman_json(result.friedman),
        "provenance": provenance(result),
    }


def report_html(result: Report) -> str:
    """Return the report as one page that needs no network."""
    from jinja2 import Environment

    environment = Environment(autoescape=True, trim_blocks=False)
    source = (files("analysis") / "templates" / "report.html").read_text(encoding="utf-8")
    return environment.from_string(source).render(
        title=result.title,
        rehearsals=result.rehearsals,
        lines=result.table4.lines(MISSING_ON_PAGE),
        missing=MISSING_ON_PAGE,
        friedman=friedman_line(result.friedman),
        figure=scores_figure(result.loaded.table),
        provenance=provenance(result),
        left_out={why: count for why, count in left_out(result.loaded).items() if count},
        unfinished=result.loaded.unfinished,
    )


def write_report(result: Report, folder: Path) -> list[Path]:
    """Write `table4.csv`, `report.html` and `report.json` into `folder`; return their paths."""
    contents = {
        "table4.csv": table4_csv(result.table4),
        "report.html": report_html(result),
        "report.json": json_text(report_json(result)),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in contents.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    return [folder / name for name in contents]


def json_text(document: object) -> str:
    """Return `document` as JSON for people and programs."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def left_out(loaded: Loaded) -> dict[str, int]:
    """Return how much of the study the report leaves out, by reason."""
    return {
        "rehearsals": loaded.rehearsals_left_out,
        "sessions excluded": loaded.sessions_excluded,
        "sessions withdrawn": loaded.sessions_withdrawn,
        "trials excluded": loaded.trials_excluded,
    }


def friedman_line(test: Friedman | NoAnswer) -> str:
    """Return the omnibus test in one sentence."""
    if isinstance(test, NoAnswer):
        return f"Friedman's test: none ({test.reason})."
    return (
        f"Friedman's test of equal conditions: χ²({test.df}) = {test.chi2:.4f}, "
        f"p = {test.p:.4g}; Kendall's W = {test.kendall_w:.3f}."
    )


def provenance(result: Report) -> dict[str, str]:
    """Return what the report was made from."""
    csv = table4_csv(result.table4)
    return {
        "scores": ", ".join(result.loaded.kinds),
        "sha256 of table4.csv": sha256(csv.encode()).hexdigest(),
        "touchbeam": version("touchbeam"),
    }


def _friedman_json(test: Friedman | NoAnswer) -> dict[str, Any]:
    if isinstance(test, NoAnswer):
        return {"chi2": None, "df": None, "p": None, "reason": test.reason}
    return {"chi2": test.chi2, "df": test.df, "p": test.p}


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
