"""Power and precision as JSON, as lines of a terminal, in words and as figures."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from analysis.estimates import Json
from analysis.power import diagnosands
from analysis.power.diagnosands import Findings, Measured, finite, too_often
from analysis.power.diagnosis import BY_GROUP
from analysis.report.drawing import Panel, Series, panels_files
from protocol.registration.registration import GAINS, NOTICED, OMNIBUS
from protocol.study.study import Study

# The convention of Cohen (Statistical Power Analysis, 1988).
ENOUGH = 0.8
_LEAST = 0.9
"""Coverage of a 95% interval below which a warning is due."""
_MOST_PAIRS = 15
"""In a table on the terminal."""
RELATIVE = "M2 relative gain"
FAMILY = (
    "Supported is what holds for the whole report at 5%: that the conditions differ and that gains "
    "differ are one family with Holm's correction; a pair counts only if the conditions differ, by "
    "its p after Holm's correction over all pairs. With catch trials, that changes are noticed is "
    "a third question of the family; a condition counts as noticed only if changes are. So are "
    "the questions about groups and the effects of factors; a pair of groups counts only if groups "
    "differ."
)
KOLMOGOROV = 1.358
"""The 95% quantile of √n times the largest distance of an empirical distribution from its own."""
_DIAGNOSANDS = ("bias", "rmse", "coverage", "width", "power", "type_s", "type_m")


def power_record(found: Sequence[Findings], study: Study, study_sha256: str, seed: int) -> Json:
    """Return everything that is found as JSON; the first design is the one in the foreground.

    `study_sha256` is the digest of the file that `study` was read from.
    """
    first = found[0]
    designs = [_design_record(each, study) for each in found]
    return {
        "studies": first.studies,
        "seed": seed,
        "study_sha256": study_sha256,
        **designs[0],
        "answer": answer(found),
        "warnings": warnings(found, study.rating.score_when),
        "family": FAMILY,
        "designs": designs,
    }


def _design_record(found: Findings, study: Study) -> Json:
    asked, null = found.design, found.any_false_claim.as_json("any_supported")
    supported = {name: each.as_json("share") for name, each in found.false_claims.items()}
    registered = [
        {"name": each.name, "row": each.row or None, **each.power.as_json("power")}
        for each in found.registered
    ]
    return {
        "design": {
            "participants": asked.participants,
            "repeats": asked.repeats,
            "levels": asked.levels or max(len(condition.levels) for condition in study.condition),
            "sessions": study.design.sessions,
            "conditions": list(study.conditions),
        },
        "omnibus": found.omnibus,
        "tests": [
            {"name": test.name}
            | test.power.as_json("power")
            | test.supported.as_json("supported", "supported_mc_error")
            for test in found.tests
        ],
        "estimates": [_estimate_record(estimate) for estimate in found.estimates],
        "null": {"studies": found.null_studies, **null, "supported": supported},
        **(
            {"registered": {"primary": registered[0], "secondary": registered[1:]}}
            if registered
            else {}
        ),
        "answer": design_answer(found),
    }


def _estimate_record(estimate: diagnosands.EstimateQuality) -> Json:
    measured: dict[str, Measured] = {name: getattr(estimate, name) for name in _DIAGNOSANDS}
    return {
        "name": estimate.name,
        "truth": finite(estimate.truth),
        **{name: finite(each.value) for name, each in measured.items()},
        "mc_error": finite(estimate.coverage.error),
        "mc_errors": {name: finite(each.error) for name, each in measured.items()},
        "estimable": estimate.estimable,
        "calibration": _calibration(estimate),
    }


def _calibration(estimate: diagnosands.EstimateQuality) -> Json:
    """Return how far the ranks of the truth are from a uniform distribution, and how far may be."""
    if not (count := len(estimate.ranks)):
        return {"studies": 0, "largest_difference": None, "band": None}
    return {
        "studies": count,
        "largest_difference": finite(float(np.abs(_ecdf_difference(estimate.ranks)).max())),
        "band": KOLMOGOROV / math.sqrt(count),
    }


def answer(found: Sequence[Findings]) -> str:
    """Return the answer in words: of the one design, or of the smallest one that does."""
    if len(found) == 1:
        return design_answer(found[0])
    # By trials altogether, which is what a study costs.
    by_size = sorted(found, key=lambda it: (it.design.participants * it.design.repeats, it.design))
    for each in by_size:
        if _supported(each, OMNIBUS).value >= ENOUGH:
            told = "The smallest design with 80% power to tell that the conditions differ"
            return f"{told}: {design_answer(each)}"
    return f"No design has 80% power; the largest: {design_answer(by_size[-1])}"


def warnings(found: Sequence[Findings], score_when: str = "always") -> list[str]:
    """Return what a report of the study would promise and not keep.

    `score_when` is the study's rule on when a score is asked for.
    """
    # A number of people or a claim that does not hold must not look like an answer.
    broken = [line for each in found for line in (*_false_claims(each), *_narrow(each))]
    most = max(found, key=lambda each: each.unscored.value)
    if score_when == "always" or not most.unscored.value > 0:
        return broken
    agrees = "the answer agrees with the expectation"
    where = {"agrees": agrees, "noticed": "a change was noticed"}[score_when]
    return [
        *broken,
        f"{most.design}: scores are asked for only where {where}, so that in "
        f"{_percent(most.unscored.value)} of studies somebody has none under some condition; tests "
        "of scores then compare only such trials, on which differences are smaller and fewer "
        "people can be compared",
    ]


def _false_claims(found: Findings) -> list[str]:
    guilty = [name for name, each in found.false_claims.items() if too_often(each)]
    if not guilty and not too_often(found.any_false_claim):
        return []
    any_of_them = _percent(found.any_false_claim.value)
    told = [
        f"{found.design}: without any effect {any_of_them} of reports claim something, where at "
        "most 5% should"
    ]
    for name in guilty:
        share = _percent(found.false_claims[name].value)
        told.append(f"do not claim {name!r}, which {share} of them do")
    return ["; ".join(told)]


def _narrow(found: Findings) -> list[str]:
    """Return which 95% intervals hold the truth in less than 90%, beyond Monte Carlo error."""
    # Two Monte Carlo errors, so that chance alone seldom warns.
    narrow = [it for it in found.estimates if it.coverage.value + 2 * it.coverage.error < _LEAST]
    if not narrow:
        return []
    worst = min(narrow, key=lambda each: each.coverage.value)
    others = f", and {len(narrow) - 1} other estimates do in less than 90%" * (len(narrow) > 1)
    share = _percent(worst.coverage.value)
    return [f"{found.design}: the 95% intervals of {worst.name} hold the truth in {share}{others}"]


def _supported(found: Findings, name: str) -> Measured:
    return next(test.supported for test in found.tests if test.name == name)


def design_answer(found: Findings) -> str:
    """Return what one design can tell, in words."""
    parts = [
        f"relative gains to within ±{estimate.width.value / 2:.1f}"
        for estimate in found.estimates
        if estimate.name == RELATIVE and math.isfinite(estimate.width.value)
    ]
    told = {OMNIBUS: "the conditions differ", NOTICED: "changes are noticed"}
    supported = {test.name: test.supported.value for test in found.tests}
    parts += [
        f"{_percent(supported[name])} power to tell that {what}"
        for name, what in told.items()
        if name in supported
    ]
    if of_design := _of_design(found):
        able = [repr(test.name) for test in of_design if test.supported.value >= ENOUGH]
        none = "less than 80% power for every question about groups and factors"
        parts.append(f"80% power for {', '.join(able)}" if able else none)
    strong = _pairs_with_power(found)
    more = f" and {len(strong) - 4} more pairs" if len(strong) > 5 else ""
    listed = f"80% power for {', '.join(strong[: 4 if more else 5])}{more}"
    parts.append(listed if strong else "less than 80% power for every pair of conditions")
    parts += [
        f"{_percent(each.power.value)} power for the registered primary hypothesis, {each.name}"
        for each in found.registered[:1]
    ]
    return f"{found.design}: {', '.join(parts)}."


def _pairs_with_power(found: Findings) -> list[str]:
    """Return the pairs that are told apart often enough, such as `voltage above structure`."""
    names, pairs = [], _pairs(found)
    # Mean differences stand last among the estimates, in the order of the tests.
    for test, difference in zip(pairs, found.estimates[-len(pairs) :], strict=True):
        if test.supported.value >= ENOUGH:
            ends = test.name.split(" - ")
            names.append(" above ".join(ends if difference.truth > 0 else reversed(ends)))
    return names


def _pairs(found: Findings) -> list[diagnosands.TestPower]:
    return [test for test in found.tests if test.after == (OMNIBUS,)]


def _of_design(found: Findings) -> list[diagnosands.TestPower]:
    """Return the questions about groups and factors."""
    known = {OMNIBUS, GAINS, NOTICED}
    return [test for test in found.tests if not test.after and test.name not in known]


def _percent(value: float) -> str:
    return f"{value:.0%}" if math.isfinite(value) else "unknown"


def left_out(found: Findings) -> set[str]:
    """Return the pairs that are not shown on a terminal: of many those that have least power."""
    many = (_pairs(found), [test for test in found.tests if BY_GROUP in test.after])
    by_power = (sorted(each, key=lambda test: -test.power.value) for each in many)
    hidden = {test.name for each in by_power for test in each[_MOST_PAIRS:]}
    # What was registered is shown, however little power it has.
    return hidden - {each.row for each in found.registered}


def lines_of_tests(found: Findings) -> list[list[str]]:
    """Return the table of tests: a header, rows, and a footer."""
    hidden = left_out(found)
    rows = [
        [
            _marked(found, test.name),
            *map(_with_error, (test.power, test.supported, found.false_claims[test.name])),
        ]
        for test in found.tests
        if test.name not in hidden
    ]
    footer = ["anything", "", "", _with_error(found.any_false_claim)]
    return [["test", "power", "supported", "without any effect"], *rows, footer]


def lines_of_estimates(found: Findings) -> list[list[str]]:
    """Return the table of the models' estimates: a header, rows, and an empty footer."""
    names = ("bias", "rmse", "coverage", "width", "type_s", "type_m")
    hidden = {f"mean difference {name}" for name in left_out(found)}
    header = ["estimate", "bias", "RMSE", "coverage", "width", "type S", "type M"]
    rows = [
        [_marked(found, each.name), *(_with_error(getattr(each, name)) for name in names)]
        for each in found.estimates
        if each.name not in hidden
    ]
    for row in rows:
        # Their truth is such that the mean error is 0 in any case: it would look like a finding.
        if "mean difference" in row[0] or "relative gain" in row[0]:
            row[1] = "–"
    return [header, *rows, [""] * len(header)]


def _marked(found: Findings, row: str) -> str:
    """Return the name of a row; it says which row decides on a registered hypothesis."""
    places = [place for place, each in enumerate(found.registered) if each.row == row]
    if not places:
        return row
    return f"{row} (registered{', primary' * (0 in places)})"


def _with_error(measured: Measured) -> str:
    if not math.isfinite(measured.value):
        return "–"
    return f"{measured.value:.3f} ±{measured.error:.3f}"


def figures(found: Sequence[Findings]) -> dict[str, bytes]:
    """Return the figure files by name: curves over the designs, and calibration of intervals."""
    panels = {"power": _curves(found), "calibration": _calibration_panels(found[0])}
    return {
        f"{name}.{kind}": content
        for name, drawn in panels.items()
        if drawn
        for kind, content in panels_files(drawn, ("svg", "png")).items()
    }


def _curves(found: Sequence[Findings]) -> list[Panel]:
    lines: dict[str, list[Findings]] = {}
    for each in sorted(found, key=lambda one: one.design):
        lines.setdefault(str(each.design).partition(" x ")[2], []).append(each)

    def curve(title: str, y_label: str, measured: Callable[[Findings], Measured]) -> Panel:
        series = []
        for name, own in lines.items():
            x = np.array([float(each.design.participants) for each in own])
            known = [(each.value, 1.96 * each.error) for each in map(measured, own)]
            y, error = np.array(known).T
            series.append(Series(label=name, x=x, y=y, error=error, marked=len(own) == 1))
        return Panel(
            title=title,
            x_label="participants",
            y_label=y_label,
            of_shares=y_label.startswith("share"),
            series=tuple(series),
        )

    names = (OMNIBUS, GAINS, *(test.name for test in _of_design(found[0])))
    panels = [
        curve(f"Power: {name}", "share of studies", partial(_supported, name=name))
        for name in names
    ]
    if any(estimate.name == RELATIVE for estimate in found[0].estimates):
        unit = "points per unit of contrast"
        panels.append(curve("Half-width of relative gains", unit, _half_width))
    return [*panels, curve("Share of pairs told apart", "share of pairs", _told_apart)]


def _half_width(found: Findings) -> Measured:
    width = next(each.width for each in found.estimates if each.name == RELATIVE)
    return Measured(width.value / 2, width.error / 2)


def _told_apart(found: Findings) -> Measured:
    pairs = [test.supported for test in _pairs(found)]
    value = float(np.mean([each.value for each in pairs]))
    # The pairs share their studies: the error of the mean is at most the mean of the errors.
    return Measured(value, float(np.mean([each.error for each in pairs])))


# Steps of .01 are finer than a figure shows.
_GRID = np.linspace(0.0, 1.0, 101)


def _ecdf_difference(ranks: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the empirical distribution of the ranks less the uniform one, on a grid."""
    return np.searchsorted(np.sort(ranks), _GRID, side="right") / len(ranks) - _GRID


def _calibration_panels(found: Findings) -> list[Panel]:
    """Return, for each interval, the distribution of the truth's rank less the uniform one."""
    return [
        Panel(
            title=estimate.name,
            x_label="posterior probability below the truth",
            y_label="difference from uniform",
            series=(
                Series(
                    label="95% band of a calibrated interval",
                    x=_GRID,
                    y=np.zeros(len(_GRID)),
                    error=np.full(len(_GRID), KOLMOGOROV / math.sqrt(len(estimate.ranks))),
                ),
                Series(label="found", x=_GRID, y=_ecdf_difference(estimate.ranks)),
            ),
        )
        for estimate in found.estimates
        if len(estimate.ranks)
    ]
