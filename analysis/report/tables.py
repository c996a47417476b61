"""The tables of the report's page: caption, header and cells as text."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from analysis.estimates import NotEstimable
from analysis.loading.score_table import ScoreTable
from analysis.report.figure_data import Course, Gains
from analysis.report.wording import interval, number, omnibus_line, p_value, share
from analysis.sensitivity.joint_model import JointSensitivity
from analysis.statistics.ordinal import OrdinalEffects
from analysis.statistics.signed_rank import PairwiseTest, SignedRank
from analysis.statistics.summary import Reading, TableStatistics
from analysis.statistics.two_way import IntraclassCorrelation
from analysis.trials.law_comparison import LawLikelihood, LawOrder
from analysis.trials.trial_statistics import PAPERS_RANKING, CatchAnswers, LawScore

Line = Sequence[str]


@dataclass(frozen=True, kw_only=True)
class PageTable:
    """A table: the first cell of each row names it; `name` is its id in the page."""

    name: str
    caption: str
    header: Line
    rows: Sequence[Line]


def readings_table(readings: Sequence[Reading]) -> PageTable:
    """Return the means and the omnibus test under each reading of withheld scores."""
    words = {"missing": "left missing", "zero": "as 0", "lowest": "as the lowest score given"}
    first = readings[0].table4.table
    return PageTable(
        name="readings",
        caption="What follows if scores that were withheld, as the answer disagreed, are left "
        "missing, read as 0 (no effect), or read as the lowest score that anybody gave: mean of "
        "each condition, and the omnibus test. Blank cells of a published table are taken for "
        "such; cells whose trials are excluded or were never reached stay missing throughout.",
        header=["withheld scores", *first.conditions, "all", "pairs that differ (Holm)", "test"],
        rows=[
            [
                words[reading.name],
                *(number(mean, 2) for mean in reading.table4.column_means),
                number(reading.table4.grand_mean, 2),
                str(sum(differs(pair) for pair in reading.pairwise)),
                omnibus_line(reading),
            ]
            for reading in readings
        ],
    )


def differs(pair: PairwiseTest) -> bool:
    """Whether a pair of conditions differs after Holm's correction, p < .05."""
    return not isinstance(pair.p_holm, NotEstimable) and pair.p_holm < 0.05


def pairwise_table(pairs: Sequence[PairwiseTest]) -> PageTable:
    """Return the signed rank test of each pair of conditions."""
    return PageTable(
        name="pairwise",
        caption="Wilcoxon's signed rank test of each pair of conditions, two-sided. V is the sum "
        "of the ranks of positive differences; differences of zero are dropped and counted; "
        "p (Holm) is corrected for the number of pairs that have a test.",
        header=["pair", "V", "n", "zeros", "rank-biserial r", "p", "p (Holm)", "method"],
        rows=[[f"{pair.a} − {pair.b}", *_pair_cells(pair)] for pair in pairs],
    )


def _pair_cells(pair: PairwiseTest) -> Line:
    test = pair.test
    if not isinstance(test, SignedRank):
        return [*[number(None)] * 6, test.reason]
    return [
        f"{test.statistic:g}",
        str(test.n),
        str(test.n_zero),
        number(test.rank_biserial, 2),
        p_value(test.p),
        p_value(pair.p_holm),
        test.method,
    ]


def icc_table(found: TableStatistics) -> PageTable:
    """Return both intraclass correlations, named by their target."""
    targets = {
        "subjects (how well one condition's score stands for a person)": found.icc_subjects,
        "conditions (how well one person's score stands for a condition)": found.icc_conditions,
    }
    return PageTable(
        name="icc",
        caption="Intraclass correlations by target (Shrout and Fleiss): (2,1) absolute agreement "
        "of single scores, (3,1) consistency of single scores, (3,k) consistency of means.",
        header=["target", "ICC(2,1)", "ICC(3,1)", "ICC(3,k)"],
        rows=[[target, *_icc_cells(icc)] for target, icc in targets.items()],
    )


def _icc_cells(icc: IntraclassCorrelation | NotEstimable) -> Line:
    if isinstance(icc, NotEstimable):
        return [f"none: {icc.reason}", number(None), number(None)]
    values = (icc.agreement_single, icc.consistency_single, icc.consistency_mean)
    return [number(value) for value in values]


def condition_table(
    table: ScoreTable, found: TableStatistics, ordinal: Mapping[str, OrdinalEffects | NotEstimable]
) -> PageTable:
    """Return each condition's effect: additive, and on the latent scales of the ordinal models."""
    additive: Mapping[str, float] = (
        {} if isinstance(found.additive, NotEstimable) else found.additive.conditions
    )
    return PageTable(
        name="conditions",
        caption="Effects of conditions: additive, in rating points about the grand mean; and of "
        "the ordinal mixed model with a random level of each subject, on its latent scale against "
        f"{table.conditions[0]}, with standard errors.",
        header=["condition", "additive", *(f"ordinal, {link}" for link in ordinal)],
        rows=[
            [name, number(additive.get(name)), *(_effect(e, name) for e in ordinal.values())]
            for name in table.conditions
        ],
    )


def _effect(found: OrdinalEffects | NotEstimable, name: str) -> str:
    if isinstance(found, NotEstimable):
        return number(None)
    if name == found.reference:
        return "reference"
    return f"{number(found.effects[name])} ± {number(found.standard_errors[name])}"


def subject_table(found: TableStatistics) -> PageTable | None:
    """Return each subject's level and slope, None where there are none."""
    effects, gains = found.additive, found.heterogeneity
    if isinstance(effects, NotEstimable):
        return None
    slopes: Mapping[str, float] = {} if isinstance(gains, NotEstimable) else gains.gains
    return PageTable(
        name="subjects",
        caption="Each subject's additive effect in rating points, the share of it that is to be "
        "believed (shrinkage), and the slope of the subject's scores on the conditions' effects "
        "(1 on average).",
        header=["subject", "additive", "shrinkage", "slope"],
        rows=[
            [
                name,
                number(effect),
                number(effects.subject_shrinkage[name]),
                number(slopes.get(name)),
            ]
            for name, effect in effects.subjects.items()
        ],
    )


def quartile_table(table: ScoreTable) -> PageTable:
    """Return what the clouds show: how many scores, and their spread, by condition."""
    import numpy as np

    rows = []
    for name, column in zip(table.conditions, table.scores.T, strict=True):
        given = column[~np.isnan(column)]
        spread = np.quantile(given, [0, 0.25, 0.5, 0.75, 1]) if given.size else [np.nan] * 5
        mean = float(given.mean()) if given.size else np.nan
        rows.append([name, str(given.size), number(mean, 2), *(number(q, 2) for q in spread)])
    return PageTable(
        name="quartiles",
        caption="The numbers behind the figure; single scores stand in Table 4.",
        header=["condition", "n", "mean", "lowest", "quartile", "median", "quartile", "highest"],
        rows=rows,
    )


def prediction_table(table: ScoreTable, laws: Sequence[LawScore]) -> PageTable:
    """Return the contrast that each law predicts for each condition, beside the mean score."""
    from analysis.statistics.table4 import table4

    means = table4(table).column_means
    physical = [score for score in laws if not isinstance(score.likelihood, NotEstimable)] or laws
    return PageTable(
        name="predictions",
        caption="Mean predicted contrast of each condition under each friction law (change of log "
        "friction; positive is the expected change), beside the mean score.",
        header=["condition", "mean score", *(score.law for score in physical)],
        rows=[
            [
                name,
                number(mean, 2),
                *(number(score.predicted.get(name), 4) for score in physical),
            ]
            for name, mean in zip(table.conditions, means, strict=True)
        ],
    )


def law_table(laws: Sequence[LawScore]) -> PageTable:
    """Return each law's score side by side."""
    return PageTable(
        name="laws",
        caption="Each friction law against the ratings: does it order the conditions as people "
        "did (Spearman's correlation of predicted contrasts with mean scores, p over all orders, "
        "and the least correlation of these ranks, ties and all, that has p < .05), and does it "
        "explain who felt what (largest log-likelihood of M1 with its contrasts, the gain over "
        "subjects who differ in level alone, and p of the gain: the share of all assignments of "
        "its contrasts to the conditions that gain as much)." + _circular(laws),
        header=[
            "law",
            "Spearman",
            "p",
            "p < .05 takes",
            "order, strongest first",
            "log-likelihood",
            "gain",
            "p of the gain",
        ],
        rows=[[score.law, *_order_cells(score.order), *_felt(score.likelihood)] for score in laws],
    )


def _circular(laws: Sequence[LawScore]) -> str:
    if all(score.law != PAPERS_RANKING for score in laws):
        return ""
    return (
        " The paper's own ranking (voltage first, pressure last, nothing said of the others) was "
        "read off the paper's Table 4: scored on those very data it is circular and no evidence."
    )


def _order_cells(order: LawOrder | NotEstimable) -> Line:
    if isinstance(order, NotEstimable):
        return [*[number(None)] * 3, f"none: {order.reason}"]
    needed = order.rank_needed
    return [
        number(order.spearman, 2),
        p_value(order.p),
        "none" if isinstance(needed, NotEstimable) else number(needed, 2),
        in_order(order),
    ]


def in_order(order: LawOrder) -> str:
    """Return the conditions from the strongest predicted contrast on, `=` between equal ones."""
    return " > ".join(" = ".join(group) for group in order.tied)


def _felt(found: LawLikelihood | NotEstimable) -> Line:
    if isinstance(found, NotEstimable):
        return [number(None)] * 3
    gain_p = found.gain_p
    told = f"none: {gain_p.reason}" if isinstance(gain_p, NotEstimable) else p_value(gain_p)
    return [number(found.log_likelihood, 2), number(found.gain_over_none, 2), told]


def gains_table(data: Gains) -> PageTable:
    """Return every subject's bias and gain under each model, with intervals and shrinkage."""
    header = ["subject"]
    for model in data.models:
        header += [f"{model} bias", "95 %", f"{model} gain", "95 %", "own share"]
    names = [line.subject for line in next(iter(data.models.values())).subjects]
    rows = [["group", *_group_cells(data)]]
    for place, name in enumerate(names):
        cells = [name]
        for lines in data.models.values():
            line = lines.subjects[place]
            cells += [number(line.bias, 2), interval(line.bias_interval)]
            cells += [number(line.gain, 2), interval(line.gain_interval)]
            cells.append(number(line.shrinkage, 2))
        rows.append(cells)
    return PageTable(
        name="gains",
        caption="Bias (rating at no contrast) and sensitivity (gain, rating points per unit of "
        "contrast) of each subject and of the group, with 95 % intervals. The own share says how "
        "much of a gain comes from the subject's own trials; the rest is borrowed from the group.",
        header=header,
        rows=rows,
    )


def _group_cells(data: Gains) -> list[str]:
    cells: list[str] = []
    for lines in data.models.values():
        cells += [number(lines.bias, 2), interval(lines.bias_interval)]
        cells += [number(lines.gain, 2), interval(lines.gain_interval), ""]
    return cells


def detection_table(found: JointSensitivity) -> PageTable:
    """Return each subject's d′ and criterion by M3."""
    return PageTable(
        name="detection",
        caption="Noticing a change (M3: answers and ratings as one ordered scale): d′ at a "
        f"contrast of {found.reference_contrast:.3f}, and criterion, with 95 % intervals.",
        header=["subject", "d′", "95 %", "criterion", "95 %", "gain", "95 %"],
        rows=[
            [
                entry.subject,
                number(entry.d_prime, 2),
                interval(entry.d_prime_interval),
                number(entry.criterion, 2),
                interval(entry.criterion_interval),
                number(line.gain, 2),
                interval(line.gain_interval),
            ]
            for entry, line in zip(found.detection, found.ratings.lines.subjects, strict=True)
        ],
    )


def course_table(data: Course) -> PageTable:
    """Return the mean score at each place of the session."""
    return PageTable(
        name="course",
        caption="The numbers behind the figure: mean score by place in the session.",
        header=["place", "mean score", "standard error", "scores"],
        rows=[
            [str(place), number(mean, 2), number(error, 2), str(count)]
            for place, mean, error, count in zip(
                data.places.tolist(),
                data.means.tolist(),
                data.errors.tolist(),
                data.counts.tolist(),
                strict=True,
            )
        ],
    )


def catch_table(found: CatchAnswers) -> PageTable:
    """Return hits and false alarms of each subject."""
    rows: list[Line] = []
    for who, answers in found.subjects.items():
        if isinstance(answers, NotEstimable):
            rows.append([who, f"none: {answers.reason}", *[number(None)] * 3])
            continue
        told = (share(answers.hits), share(answers.false_alarms))
        rows.append([who, *told, number(answers.d_prime, 2), number(answers.criterion, 2)])
    return PageTable(
        name="catch",
        caption="Trials on which a change was reported, whichever it was: scored trials (hits) and "
        "catch trials at 0 V (false alarms), with exact 95 % intervals; d′ and criterion from "
        "counts alone.",
        header=["subject", "hits", "false alarms", "d′", "criterion"],
        rows=rows,
    )


def listing(name: str, caption: str, header: Line, rows: Iterable[Line]) -> PageTable | None:
    """Return a table of what happened, None where nothing did."""
    found = list(rows)
    return PageTable(name=name, caption=caption, header=header, rows=found) if found else None
