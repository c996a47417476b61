"""Report of a study as an HTML page, tables, figures and JSON."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from analysis.cells import json_text
from analysis.felt.measured_statistics import measured_statistics
from analysis.loading.study_data import StudyData
from analysis.report.blocks import Figure, Section
from analysis.report.drawing import FORMATS
from analysis.report.findings import Findings, Origin
from analysis.report.page import SECTIONS, page_html, require_sections
from analysis.statistics.summary import TableStatistics
from analysis.trials.trial_statistics import TrialStatistics
from device.friction.calibration import NOMINAL
from device.friction.changes import LAW
from device.friction.surfaces import GivenSurface, length_of
from protocol.study.study import Study

ALWAYS = frozenset({"table4", "provenance"})
"""The sections without which there is no report."""


def _figure_paths(name: str) -> list[str]:
    return [f"figures/{name}{end}" for end in FORMATS]


@dataclass(frozen=True, kw_only=True, eq=False)
class Report(Findings):
    """Findings of a study and the sections that present them."""

    shown: tuple[str, ...] | None = None
    """Names of the sections that the page shows, in their order; None for all."""

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """All sections, shown or not; if they are wanted `alone`, those shown and `ALWAYS`."""
        return tuple(replace(SECTIONS[name].make(self), name=name) for name in self.needed)

    @property
    def needed(self) -> tuple[str, ...]:
        # `report.toml` chooses what the page shows; `report.json` has every number all the same.
        wanted = {*self._shown, *ALWAYS} if self.origin.alone else SECTIONS.keys()
        return tuple(name for name in SECTIONS if name in wanted and self._has(name))

    def _has(self, section: str) -> bool:
        part = SECTIONS[section]
        if part.of_predictions and not self.is_predicted:
            return False
        return bool(self.loaded.table.conditions) or part.of_tracks

    @property
    def chosen(self) -> tuple[Section, ...]:
        """Sections of the page, in its order; that on the registration is never left out."""
        known = {section.name: section for section in self.sections}
        return tuple(known[name] for name in self._shown)

    @property
    def _shown(self) -> tuple[str, ...]:
        names = self.shown or tuple(SECTIONS)
        # A report cannot hide that it departs from what was registered.
        if self.loaded.lock is not None and "registration" not in names:  # the page refers to it
            names = ("registration", *names)
        return tuple(name for name in dict.fromkeys(names) if self._has(name))

    @cached_property
    def fronts(self) -> tuple[Section, ...]:
        """Sections with at least what stands among the results."""
        own = {section.name: section for section in self.sections}
        return tuple(
            own.get(name) or Section(blocks=list(part.front(self)), name=name)
            for name, part in SECTIONS.items()
            if part.front and self._has(name)
        )

    @property
    def figures(self) -> list[Figure]:
        """Figures of these sections and among the results, drawn or not."""
        whole = {section.name: section for section in (*self.fronts, *self.sections)}
        in_order = (whole[name] for name in SECTIONS if name in whole)
        return [figure for section in in_order for figure in section.figures]


# An earlier report may have left figures that this one does not have; these are removed.
FIGURE_FILES = frozenset(
    path for part in SECTIONS.values() for name in part.figures for path in _figure_paths(name)
)


def report(
    title: str,
    loaded: StudyData,
    study: Study,
    origin: Origin,
    shown: tuple[str, ...] | None = None,
) -> Report:
    """Return the report on the data `loaded` from `study`; its page shows the sections `shown`.

    Scores of a published table were felt on a rig of their own, which no calibration describes.

    Raises:
        BadInput: there is no section of a name in `shown`.
    """
    require_sections(shown or ())
    if loaded.kinds == ("published",):
        # The paper's people felt another rig than the one that stands here. What was felt in other
        # tables no model knows.
        nobodys = NOMINAL.on(GivenSurface(length_m=length_of(study.surface)))
        origin = replace(origin, rig=nobodys if study.imported else NOMINAL)
    if loaded.lock is not None:
        origin = origin.under(loaded.lock)
    trials = TrialStatistics(data=loaded, study=study, rig=origin.rig)
    return Report(
        title=title,
        loaded=loaded,
        study=study,
        origin=origin,
        table=TableStatistics(table=loaded.table, catch=loaded.catch_scores),
        trials=trials,
        measured=measured_statistics(study, loaded, trials.contrasts.by_law[LAW]),
        shown=shown,
    )


_KEYS = (
    *("title", "kinds", "rehearsals", "broken_chains", "unfinished", "left_out", "exclusions"),
    *("left_out_for_not_noticing", "incidents", "table4"),
    *("friedman", "skillings_mack", "kendall_w", "kendall_w_interval"),
    *("interval_coverage", "rank_sums", "pairwise", "questions_p_holm", "responses", "scores"),
    "directions",
    *("sensitivity_model", "sensitivity_note", "sensitivity", "noticing", "rating"),
    "sensitivity_coverage",
    *("measured", "recovery"),
    *("contrast_law", "contrast_rung", "contrast_ranges", "laws", "checks", "signal"),
    *("questions", "trials", "provenance", "registration"),
)
"""Order of the keys of `report.json`, fixed so that two reports can be compared; others follow."""


def report_json(result: Report) -> dict[str, Any]:
    """Return every number of the report; a missing number is `null`, with the reason beside it."""
    found: dict[str, Any] = {
        "title": result.title,
        "kinds": list(result.loaded.kinds),
        "rehearsals": result.rehearsals,
        "broken_chains": list(result.origin.broken_chains),
    }
    for section in result.sections:
        found.update(section.data)
    # The sort keeps the order of what has the same place, so that a reason follows its number.
    return {key: found[key] for key in sorted(found, key=_place)}


def _place(key: str) -> int:
    """Return the position of a key; a reason follows the number that it explains."""
    name = key.removesuffix("_reason")
    return _KEYS.index(name) if name in _KEYS else len(_KEYS)


def report_html(result: Report) -> str:
    """Return the report as one page that needs no network."""
    return page_html(result, result.fronts, result.chosen)


def report_files(result: Report, *, figures: bool) -> dict[str, bytes]:
    """Return the contents of the report's files, by relative path, those of `figures` if asked."""
    texts = {name: text for section in result.sections for name, text in section.files.items()}
    texts["report.html"] = report_html(result)
    texts["report.json"] = json_text(report_json(result))
    found = {name: text.encode() for name, text in texts.items()}
    for figure in result.figures if figures else ():
        if figure.drawing is not None:
            paths = _figure_paths(figure.name)
            found |= dict(zip(paths, figure.drawing.files().values(), strict=True))
    return found
