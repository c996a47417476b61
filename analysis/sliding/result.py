"""The result of a sliding experiment for people and programs: lines, JSON, and a page."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from analysis.cells import json_text
from analysis.estimates import Estimate, NotEstimable, plain
from analysis.report.blocks import Block, Definitions, Figure, Items, Section, Table, columns
from analysis.report.page import Masthead, rendered
from analysis.sliding import experiment
from analysis.sliding.comparison import Extreme, figure_panels, measured_panels
from analysis.sliding.rig_model import MeanCurve
from protocol.errors import BadInput

_UNKNOWN = "not determined"
_DRIVEN = ("voltage_v", "frequency_hz", "direction")
_CAPTION = (
    "As Fig 16 of the paper: measured friction with a band of one standard error, beside the "
    "laws and rungs, and beside the fitted rig at every drive."
)
_MEASURED = "Measured friction with a band of one standard error, at every drive and at rest."


@dataclass(frozen=True, kw_only=True, eq=False)
class SlidingResult:
    """A sliding experiment and what was found in it."""

    drawn: experiment.DrawnSession
    found: experiment.SlidingFindings

    @cached_property
    def curve(self) -> MeanCurve:
        """The driven curve nearest the measured resonance, where friction changes most."""
        driven = [curve for curve in self.found.curves if curve.setting.voltage_v > 0]
        middle_hz = self.drawn.resonance.frequency_hz
        return min(driven, key=lambda curve: abs(curve.setting.frequency_hz - middle_hz))

    def record(self) -> dict[str, Any]:
        """Return the result as JSON; `mu`, `troughs` and `peaks` are those of `curve`."""
        drawn, found = self.drawn, self.found
        own = [one for one in found.extremes if one.setting == self.curve.setting]
        return {
            "session": drawn.session,
            "rehearsal": drawn.rehearsal,
            "data_sha256": found.data_sha256,
            "passes": [
                {"index": each.index, "drive": each.drive}
                | {name: getattr(each.made, name) for name in _DRIVEN}
                for each in drawn.passes
            ],
            "planned": len(drawn.planned),
            "left_out": [{"index": index, "why": why} for index, why in drawn.left_out],
            "setting": plain(self.curve.setting),
            "mu": {name: plain(getattr(self.curve, name)) for name in ("x_m", "mu", "error")},
            "troughs": [_place(one) for one in own if one.kind == "trough"],
            "peaks": [_place(one) for one in own if one.kind == "peak"],
            "fit": {
                **{name: _estimate(each) for name, each in found.estimates.items()},
                **{name: {"reason": why} for name, (_, why) in experiment.ALWAYS_UNKNOWN.items()},
            },
            "models": plain(found.mismatches),
            "curves": plain(found.curves),
            "extremes": plain(found.extremes),
            "noise": plain(found.fit.noise),
            "deviance_per_point": plain(found.fit.deviance / found.fit.points),
        }

    def lines(self) -> Iterator[str]:
        """Yield the result in a few lines; the page has the rest."""
        drawn = self.drawn
        yield from [_sentence(self.found.reason)] if self.found.reason else self._rig_lines()
        for index, why in drawn.left_out:
            yield f"Left out: pass {index + 1}, {why}."
        if (made := len(drawn.passes) + len(drawn.left_out)) < len(drawn.planned):
            yield f"Unfinished: {made} of {len(drawn.planned)} passes have been made."
        if self.found.mismatches:
            best = min(self.found.mismatches, key=lambda one: one.rmse)
            rig = "fitted" if best.fitted else self.found.described
            closest = f"law {best.law} on rung {best.rung} for the {rig} rig"
            yield f"Closest: {closest}, RMS {best.rmse:.4f}."

    def _rig_lines(self) -> Iterator[str]:
        header, *rows = self.found.lines()
        told = [row for row in rows if row[1] != _UNKNOWN]
        widths = [max(map(len, cells)) for cells in zip(header, *told, strict=True)]
        for row in (header, *told):
            yield "  ".join(map(str.ljust, row, widths)).rstrip()
        if unknown := [row[0] for row in rows if row[1] == _UNKNOWN]:
            yield f"Not told by these passes: {', '.join(unknown)} (the page says why)."

    def files(self) -> dict[str, bytes]:
        """Return the contents of all files, by name."""
        texts = {"slide.html": self._page, "slide.json": json_text(self.record())}
        drawing = self._figure.drawing
        assert drawing is not None, "there is a driven curve"
        return {
            **{name: text.encode() for name, text in texts.items()},
            **{f"slide{end}": content for end, content in drawing.files().items()},
        }

    @cached_property
    def _figure(self) -> Figure:
        found, caption = self.found, _MEASURED if self.found.reason else _CAPTION
        if found.reason:
            drawn, table = measured_panels(found.curves), None
        else:
            drawn = figure_panels(found.curves, found.nominal, found.fit.rig)
            table = _table("places", "Troughs and peaks", found.extreme_lines())
        return Figure(name="friction", title="mu(x)", caption=caption, draw=drawn, table=table)

    @property
    def _page(self) -> str:
        drawn, found = self.drawn, self.found
        rehearsed = "The block was drawn in a rehearsal. This is no evidence about a rig."
        notices = [("Rehearsal.", rehearsed)] if drawn.rehearsal else []
        facts = {
            "Session": drawn.session,
            "Device": drawn.idn,
            "Measured resonance": f"{drawn.resonance.frequency_hz:.1f} Hz",
            "Digest of the passes (SHA-256)": found.data_sha256,
        }
        made = [["pass", "drive", "frequency, Hz", "mean μ'"]] + [
            [str(it.index + 1), it.drive, f"{it.made.frequency_hz:.1f}", f"{it.made.mu.mean():.4f}"]
            for it in drawn.passes
        ]
        left_out = [f"pass {index + 1}: {why}" for index, why in drawn.left_out]
        passes = _table("passes", "Passes in the order in which they were made", made)
        models: dict[str, list[Block]] = {}
        if found.reason:
            rig: Block = Items(lines=[_sentence(found.reason)])
        else:
            rig = _table("rig", "What the passes tell of the rig", found.lines())
            lines = found.mismatch_lines()
            models["Laws and rungs"] = [_table("models", "Distance from measured friction", lines)]
        blocks: dict[str, list[Block]] = {
            "The rig": [rig],
            "Friction by place": [self._figure],
            **models,
            "Passes": [passes, Items(lines=left_out, heading="Left out")],
            "Where this comes from": [Definitions(entries=facts)],
        }
        sections = [
            Section(name=title.lower().replace(" ", "-"), title=title, blocks=content)
            for title, content in blocks.items()
        ]
        head = Masthead(title=f"Sliding experiment {drawn.session}", authors="", facts={})
        return rendered(head, notices, sections)


def sliding_result(drawn: experiment.DrawnSession) -> SlidingResult:
    """Return the result of a sliding experiment.

    Raises:
        BadInput: its passes do not tell anything.
    """
    try:
        found = drawn.findings()
    except np.linalg.LinAlgError as error:
        raise BadInput(f"{drawn.session}: the passes are too uneven to be fitted") from error
    if isinstance(found, NotEstimable):
        raise BadInput(f"{drawn.session}: {found.reason}")
    return SlidingResult(drawn=drawn, found=found)


def _sentence(reason: str) -> str:
    return f"{reason[0].upper()}{reason[1:]}."


def _place(one: Extreme) -> dict[str, Any]:
    if isinstance(one.place_m, NotEstimable) or one.interval_m is None:
        reason = one.place_m.reason if isinstance(one.place_m, NotEstimable) else "no interval"
        return {"x_m": None, "ci": None, "reason": reason, "fitted_m": one.expected_m}
    return {"x_m": one.place_m, "ci": list(one.interval_m), "fitted_m": one.expected_m}


def _estimate(found: Estimate | NotEstimable) -> dict[str, Any]:
    if isinstance(found, NotEstimable):
        return {"reason": found.reason}
    return {"value": plain(found.value), "ci": plain(found.interval)}


def _table(name: str, caption: str, lines: list[list[str]]) -> Table:
    header, *rows = lines
    return Table(name=name, caption=caption, columns=columns(*header, kind="text"), rows=rows)
