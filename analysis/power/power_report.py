"""Power and precision as JSON, as lines of a terminal and in words."""

from collections.abc import Iterator, Sequence
from math import isfinite

from analysis.estimates import Json, plain
from analysis.power.power_summary import EstimateQuality, Measured, Summary, TestPower, too_often
from analysis.power.study_records import LEVELS, OF_GROUPS
from protocol.registration.registration import FOLLOWS, NOTICED, OMNIBUS
from protocol.study.study import Study

ENOUGH = 0.8
"""The convention of Cohen (Statistical Power Analysis, 1988)."""
_LEAST = 0.9
"""Coverage of a 95% interval below which a warning is due."""
_MOST_TOLD = 5
"""Pairs in an answer."""
FAMILY = (
    "Supported is what the whole report may claim: that the conditions differ, that responses "
    "follow the prediction{questions}, the questions about groups "
    "and the effects of factors are one family with Holm's correction; conditions also differ if "
    "responses follow the prediction or a factor has an effect. A pair counts only if the "
    "conditions differ, by its p after Holm's correction over all pairs{after}; a pair of groups "
    "only if groups differ. Where nothing has an effect, anything is claimed in at most 5% of "
    "studies."
)
_OF_NOTICING = {
    "questions": ", with catch trials that changes are noticed",
    "after": "; a condition counts as noticed only if changes are",
}


def family(study: Study) -> str:
    """Return which claims of a report on the study go together, in words."""
    return FAMILY.format(**({"questions": "", "after": ""} if study.absolute else _OF_NOTICING))


_NUMBERS = ("bias", "rmse", "coverage", "width")


# As JSON.


def power_record(summaries: Sequence[Summary], study: Study, study_sha256: str, seed: int) -> Json:
    """Return everything as JSON; the first design is the one in the foreground.

    `study_sha256` is the digest of the file that `study` was read from.
    """
    designs = [_design_record(summary, study) for summary in summaries]
    document = {
        "studies": summaries[0].studies,
        "seed": seed,
        "study_sha256": study_sha256,
        **designs[0],
        "answer": answer(summaries),
        "warnings": warnings(summaries),
        "family": family(study),
        "designs": designs,
    }
    return {name: plain(value) for name, value in document.items()}


def _design_record(summary: Summary, study: Study) -> Json:
    design = summary.design
    levels = [len(condition.levels) for condition in study.condition]
    family = [test for test in summary.tests if test.after is not None]
    without_effect = next(iter(summary.any_false_claim))
    return {
        "design": {
            "participants": design.participants,
            "repeats": design.repeats,
            "levels": design.levels or max(levels, default=0),
            "sessions": study.design.sessions,
            "conditions": study.conditions,
            **summary.told.as_json("told", "told_mc_error"),
        },
        "tests": [
            {"name": test.name}
            | test.power.as_json("power")
            | test.supported.as_json("supported", "supported_mc_error")
            for test in summary.tests
        ],
        "estimates": [_estimate_record(estimate) for estimate in summary.estimates],
        "null": {
            "studies": summary.null_studies,
            **summary.any_false_claim[without_effect].as_json("any_supported"),
            "supported": {
                test.name: test.false[without_effect].as_json("share") for test in family
            },
            "kinds": [
                {"name": kind, **made.as_json("any_supported")}
                for kind, made in summary.any_false_claim.items()
            ],
        },
        "answer": design_answer(summary),
    }


def _estimate_record(estimate: EstimateQuality) -> Json:
    numbers: dict[str, Measured] = {name: getattr(estimate, name) for name in _NUMBERS}
    return {
        "name": estimate.name,
        **{name: measured.value for name, measured in numbers.items()},
        "mc_error": estimate.coverage.error,
        "mc_errors": {name: measured.error for name, measured in numbers.items()},
        "estimable": estimate.estimable.value,
    }


# In words.


def answer(summaries: Sequence[Summary]) -> str:
    """Return the answer in words: of the one design, or of the smallest one that does."""
    if len(summaries) == 1 or not summaries[0].null_studies:  # tracks have no question
        return " ".join(map(design_answer, summaries))
    # By trials altogether, which is what a study costs.
    by_size = sorted(
        summaries, key=lambda one: (one.design.participants * one.design.repeats, one.design)
    )
    for summary in by_size:
        if any(_is_able(test) for test in summary.tests if test.name == OMNIBUS):
            begin = "The smallest design with 80% power to tell that the conditions differ"
            return f"{begin}: {design_answer(summary)}"
    return f"No design has 80% power; the largest: {design_answer(by_size[-1])}"


def _is_able(test: TestPower) -> bool:
    return test.supported.value >= ENOUGH


def design_answer(summary: Summary) -> str:
    """Return what one design can tell, in words."""
    questions = {test.name: test for test in summary.tests if test.after == ()}
    in_words = {
        OMNIBUS: "the conditions differ",
        FOLLOWS: "responses follow the prediction",
        NOTICED: "changes are noticed",
    }
    parts = [
        *_precisions(summary.estimates),
        *[f"gains of people told in {_percent(summary.told)} of studies"]
        * isfinite(summary.told.value),
        *(
            f"{_percent(questions[name].supported)} power to tell that {what}"
            for name, what in in_words.items()
            if name in questions
        ),
    ]
    parts += _of_groups_and_factors(
        summary, [test for test in questions.values() if test.name not in in_words]
    )
    return f"{summary.design}: {', '.join(parts + [_of_pairs(summary)] * bool(questions))}."


def _of_groups_and_factors(summary: Summary, tests: Sequence[TestPower]) -> Iterator[str]:
    of_groups = [test for test in tests if test.name in OF_GROUPS]
    of_factors = [test for test in tests if test not in of_groups]
    if of_groups and summary.alike:
        yield "nothing to find between groups, which are drawn from the same people"
        of_groups = []
    if able := [repr(test.name) for test in (*of_groups, *of_factors) if _is_able(test)]:
        yield f"at least 80% power for {', '.join(able)}"
    elif about := ["groups"] * bool(of_groups) + ["factors"] * bool(of_factors):
        yield f"less than 80% power for every question about {' and '.join(about)}"


def _precisions(estimates: Sequence[EstimateQuality]) -> Iterator[str]:
    for estimate in estimates:
        half = estimate.width.value / 2
        if estimate.name == LEVELS and isfinite(half):
            yield f"levels to within ±{half:.1f} points"
        if estimate.name.endswith(", dB") and isfinite(half):
            yield f"{estimate.name.removesuffix(', dB')} to within ±{half:.1f} dB"


def _of_pairs(summary: Summary) -> str:
    """Return which pairs are told apart often enough, such as `voltage and structure`."""
    pairs = [test for test in summary.tests if test.after == (OMNIBUS,) and _is_able(test)]
    if not pairs:
        return "less than 80% power for every pair of conditions"
    able = [" and ".join(test.name.split(" - ")) for test in pairs]
    more = f", and {len(able) - 4} more pairs" if len(able) > _MOST_TOLD else ""
    return f"at least 80% power to tell apart {', '.join(able[: 4 if more else None])}{more}"


def warnings(summaries: Sequence[Summary]) -> list[str]:
    """Return what a report of the study would promise and not keep."""
    # A number of people or a claim that does not hold must not look like an answer.
    return [line for one in summaries for line in (*_false_claims(one), *_narrow(one))]


def _false_claims(summary: Summary) -> Iterator[str]:
    for kind, anything in summary.any_false_claim.items():
        guilty = [test for test in summary.tests if too_often(test.false[kind])]
        if guilty or too_often(anything):
            begin = (
                f"{summary.design}: of {kind!r} {_percent(anything)} of reports claim something "
                "false, where at most 5% should"
            )
            blame = [
                f"do not claim {test.name!r}, which {_percent(test.false[kind])} of them do"
                for test in guilty
            ]
            yield "; ".join([begin, *blame])


def _narrow(summary: Summary) -> list[str]:
    """Return which 95% intervals hold the truth in less than 90%, beyond Monte Carlo error."""
    # Two Monte Carlo errors, so that chance alone seldom warns.
    narrow = [
        estimate
        for estimate in summary.estimates
        if estimate.coverage.value + 2 * estimate.coverage.error < _LEAST
    ]
    if not narrow:
        return []
    worst = min(narrow, key=lambda estimate: estimate.coverage.value)
    others = f", and {len(narrow) - 1} other estimates do in less than 90%" * (len(narrow) > 1)
    truth = f"hold the truth in {_percent(worst.coverage)}{others}"
    return [f"{summary.design}: the 95% intervals of {worst.name} {truth}"]


def _percent(share: Measured) -> str:
    return f"{share.value:.0%}" if isfinite(share.value) else "unknown"


# As lines of a terminal.


def lines_of_tests(summary: Summary) -> list[list[str]]:
    """Return the table of tests: a header, rows, and a footer."""
    rows = [
        [test.name, *map(_with_error, (test.power, test.supported, *test.false.values()))]
        for test in summary.tests
    ]
    anything = map(_with_error, summary.any_false_claim.values())
    header = ["test", "power", "supported", *summary.any_false_claim]
    return [header, *rows, ["anything false", "", "", *anything]]


def lines_of_estimates(summary: Summary) -> list[list[str]]:
    """Return the table of estimates: a header, rows, and an empty footer."""
    rows = [
        [
            estimate.name,
            *(_with_error(getattr(estimate, name)) for name in _NUMBERS),
            _percent(estimate.estimable),
        ]
        for estimate in summary.estimates
    ]
    header = ["estimate", "bias", "RMSE", "coverage", "width", "estimable"]
    return [header, *rows, [""] * len(header)]


def _with_error(measured: Measured) -> str:
    if not isfinite(measured.value):
        return "–"
    return f"{measured.value:.3f} ±{measured.error:.3f}"
