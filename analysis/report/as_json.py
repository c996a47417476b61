"""The report as data: every number of it, in the shape that programs rely on.

A number that there is none of is `null`, with a `reason` beside it, called `<name>_reason` where
only one of several numbers is lacking.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from analysis.estimates import NotEstimable
from analysis.loading.missing_scores import unscored
from analysis.loading.score_table import ScoreTable
from analysis.loading.sessions import TrialRow
from analysis.loading.study_data import Loaded
from analysis.sensitivity.checks import Discrimination, Proportion
from analysis.sensitivity.linear_model import LinearSensitivity
from analysis.sensitivity.lines import Lines, SubjectLine
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.statistics.omnibus import Friedman, SkillingsMack
from analysis.statistics.ordinal import OrdinalEffects
from analysis.statistics.signed_rank import PairwiseTest
from analysis.statistics.summary import Reading, TableStatistics
from analysis.statistics.table4 import Table4
from analysis.statistics.two_way import IntraclassCorrelation
from analysis.trials.contrasts import TrialContrasts
from analysis.trials.law_comparison import LawLikelihood, LawOrder
from analysis.trials.trial_statistics import CatchAnswers, LawScore, TrialStatistics

Json = dict[str, Any]


def plain(value: object) -> Any:
    """Return records, arrays and mappings as JSON can hold them; NaN is `null`."""
    if isinstance(value, NotEstimable):
        return {"reason": value.reason}
    if is_dataclass(value):
        return {entry.name: plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and math.isnan(value) else value


def or_null(value: object) -> Any:
    """Return a number, or `None` where there is no answer."""
    return None if isinstance(value, NotEstimable) else plain(value)


def table4_json(result: Table4) -> Json:
    """Return the table with its means; a missing score is `null`."""
    table = result.table
    return {
        "columns": list(table.conditions),
        "rows": [
            {"subject": subject, "scores": plain(scores), "comprehensive": plain(mean)}
            for subject, scores, mean in zip(
                table.subjects, table.scores, result.row_means, strict=True
            )
        ],
        "column_means": dict(zip(table.conditions, plain(result.column_means), strict=True)),
        "grand_mean": plain(result.grand_mean),
        "missing": table.missing_count,
    }


def empty_json(loaded: Loaded) -> Json:
    """Return why cells of the table have no score, and who and what has none at all."""
    table = loaded.table
    subjects, conditions = unscored(table)
    return {
        "empty": [
            {"subject": table.subjects[row], "condition": table.conditions[column], "why": str(why)}
            for (row, column), why in loaded.empty.items()
        ],
        "unscored_subjects": list(subjects),
        "unscored_conditions": list(conditions),
    }


def statistics_json(found: TableStatistics, table: ScoreTable) -> Json:
    """Return what was computed from the table of scores."""
    main = found.main
    test = main.friedman
    return {
        "friedman": friedman_json(main),
        "skillings_mack": _skillings_mack_json(main.skillings_mack),
        **_why("skillings_mack", main.skillings_mack or _COMPLETE),
        "kendall_w": test.kendall_w if isinstance(test, Friedman) else None,
        **_why("kendall_w", test),
        "rank_sums": _rank_sums(test, table),
        **_why("rank_sums", test),
        "pairwise": [_pair_json(pair) for pair in main.pairwise],
        "icc": {
            "subjects": _icc_json(found.icc_subjects),
            "conditions": _icc_json(found.icc_conditions),
        },
        "additive": _additive_json(found),
        "gain_heterogeneity": plain(found.heterogeneity),
        "missing_readings": {
            reading.name: {
                "column_means": table4_json(reading.table4)["column_means"],
                "grand_mean": plain(reading.table4.grand_mean),
                "friedman": friedman_json(reading),
                "pairwise": [_pair_json(pair) for pair in reading.pairwise],
            }
            for reading in found.readings
        }
        if len(found.readings) > 1
        else {},
    }


_COMPLETE = NotEstimable(reason="no score is missing, so that Friedman's test applies")


def _why(name: str, found: object) -> Json:
    """Return the reason for a `null` called `name`, nothing where `found` is an answer."""
    return {f"{name}_reason": found.reason} if isinstance(found, NotEstimable) else {}


def friedman_json(reading: Reading) -> Json:
    """Return Friedman's test, or `null` with Skillings and Mack's where scores are missing."""
    test = reading.friedman
    if isinstance(test, NotEstimable):
        return {
            **dict.fromkeys(("chi2", "df", "p", "p_exact")),
            "reason": test.reason,
            "skillings_mack": _skillings_mack_json(reading.skillings_mack),
        }
    return {
        "chi2": test.chi2,
        "df": test.df,
        "p": test.p,
        "p_exact": or_null(test.p_exact),
        **_why("p_exact", test.p_exact),
    }


def _skillings_mack_json(test: SkillingsMack | NotEstimable | None) -> Json | None:
    if isinstance(test, NotEstimable):
        return {**dict.fromkeys(("statistic", "df", "p")), "reason": test.reason}
    return None if test is None else dict(plain(test))


def _rank_sums(test: Friedman | NotEstimable, table: ScoreTable) -> Json | None:
    if isinstance(test, NotEstimable):
        return None
    return dict(zip(table.conditions, test.rank_sums, strict=True))


def _pair_json(pair: PairwiseTest) -> Json:
    names = {"a": pair.a, "b": pair.b}
    if isinstance(pair.test, NotEstimable):
        nothing = dict.fromkeys(
            ("statistic", "n", "n_zero", "p", "method", "rank_biserial", "p_holm")
        )
        return {**names, **nothing, "reason": pair.test.reason}
    return {**names, **plain(pair.test), "p_holm": or_null(pair.p_holm)}


def _icc_json(found: IntraclassCorrelation | NotEstimable) -> Json:
    if isinstance(found, NotEstimable):
        return {**dict.fromkeys(("2,1", "3,1", "3,k")), "reason": found.reason}
    kinds = {
        "2,1": found.agreement_single,
        "3,1": found.consistency_single,
        "3,k": found.consistency_mean,
    }
    known: Json = {name: or_null(value) for name, value in kinds.items()}
    lacking = [value.reason for value in kinds.values() if isinstance(value, NotEstimable)]
    return {**known, "reason": lacking[0]} if lacking else known


def _additive_json(found: TableStatistics) -> Json:
    effects = found.additive
    if isinstance(effects, NotEstimable):
        nothing = dict.fromkeys(("residual_sd", "subject_sd", "shrinkage"))
        return {"conditions": {}, "subjects": {}, **nothing, "reason": effects.reason}
    return {
        **plain(effects),
        "shrinkage": or_null(effects.shrinkage),
        **_why("shrinkage", effects.shrinkage),
        "subject_shrinkage": {who: or_null(s) for who, s in effects.subject_shrinkage.items()},
    }


def trial_statistics_json(found: TrialStatistics) -> Json:
    """Return what was computed from single trials."""
    m1, m2, m3 = found.m1, found.m2, found.m3
    return {
        "ordinal": {link: _ordinal_json(effects) for link, effects in found.ordinal.items()},
        "sensitivity": [
            _line_json(line)
            for line in (m1.lines.subjects if isinstance(m1, LinearSensitivity) else ())
        ],
        "sensitivity_models": {
            "M1": m1_json(m1),
            "M2": plain(m2) if isinstance(m2, NotEstimable) else _ordinal_model_json(m2),
            "M3": plain(m3)
            if isinstance(m3, NotEstimable)
            else {
                **_ordinal_model_json(m3.ratings),
                "detection": plain(m3.detection),
                "reference_contrast": m3.reference_contrast,
            },
        },
        "laws": [_law_json(score) for score in found.laws],
        "checks": {
            "order": plain(found.order),
            "carry_over": plain(found.carry_over),
            "drift": plain(found.drift),
            "catch_trials": catch_json(found.catch),
        },
        "signal": plain(found.signal),
    }


def m1_json(found: LinearSensitivity | NotEstimable) -> Json:
    """Return the fit of M1."""
    if isinstance(found, NotEstimable):
        return {"reason": found.reason}
    return {**_lines_json(found.lines), "residual_sd": found.residual_sd}


def _ordinal_model_json(found: OrdinalSensitivity) -> Json:
    return {
        **_lines_json(found.lines),
        "residual_sd": found.residual_sd,
        "categories": list(found.categories),
        "thresholds": list(found.thresholds),
        "discrepancies": plain(found.discrepancies),
    }


def _lines_json(lines: Lines) -> Json:
    return {
        "subjects": [_line_json(line) for line in lines.subjects],
        "population": {
            name: plain(getattr(lines, name)) for name in ("bias", "gain", "bias_sd", "gain_sd")
        }
        | {
            f"{name}_ci": plain(getattr(lines, f"{name}_interval"))
            for name in ("bias", "gain", "bias_sd", "gain_sd")
        },
    }


def _line_json(line: SubjectLine) -> Json:
    return {
        "subject": line.subject,
        "bias": line.bias,
        "bias_ci": list(line.bias_interval),
        "gain": line.gain,
        "gain_ci": list(line.gain_interval),
        "shrinkage": line.shrinkage,
        "trials": line.trials,
    }


def _ordinal_json(found: OrdinalEffects | NotEstimable) -> Json:
    if isinstance(found, NotEstimable):
        nothing = dict.fromkeys(("subject_sd", "log_likelihood"))
        return {"effects": {}, **nothing, "reason": found.reason}
    return dict(plain(found))


def _law_json(score: LawScore) -> Json:
    order = score.order
    known: Json = (
        {
            **dict.fromkeys(("spearman", "p", "rho_needed", "r_needed")),
            "order": [],
            "order_tied": [],
            "reason": order.reason,
        }
        if isinstance(order, NotEstimable)
        else {
            "spearman": or_null(order.spearman),
            "order": list(order.order),
            "order_tied": plain(order.tied),
            "p": or_null(order.p),
            "rho_needed": or_null(order.rank_needed),
            "r_needed": or_null(order.needed),
        }
    )
    if isinstance(order, LawOrder):
        if isinstance(order.spearman, NotEstimable):
            known["reason"] = order.spearman.reason
        known |= _why("rho_needed", order.rank_needed)
    return {
        "law": score.law,
        **known,
        "predicted": plain(score.predicted),
        "who_felt_what": _likelihood_json(score.likelihood),
    }


def _likelihood_json(found: LawLikelihood | NotEstimable) -> Json:
    if isinstance(found, NotEstimable):
        return {"reason": found.reason}
    return {**plain(found), "gain_p": or_null(found.gain_p), **_why("gain_p", found.gain_p)}


def catch_json(found: CatchAnswers) -> Json:
    """Return hits and false alarms, pooled and by subject."""
    return {
        "overall": _discrimination_json(found.overall),
        "subjects": {who: _discrimination_json(said) for who, said in found.subjects.items()},
    }


def _discrimination_json(found: Discrimination | NotEstimable) -> Json:
    if isinstance(found, NotEstimable):
        return {"reason": found.reason}
    return {
        **plain(found),
        "hits": _proportion_json(found.hits),
        "false_alarms": _proportion_json(found.false_alarms),
    }


def _proportion_json(found: Proportion) -> Json:
    ends = found.interval
    return {**plain(found), "interval": or_null(ends), **_why("interval", ends)}


def left_out_json(loaded: Loaded) -> Json:
    """Return how much of the study the report leaves out, by reason, and each case."""
    by_rule = [entry for entry in loaded.left_out if entry.by == "rule"]
    return {
        "rehearsals": loaded.rehearsals_left_out,
        "sessions excluded": loaded.sessions_excluded,
        "sessions withdrawn": loaded.sessions_withdrawn,
        "trials excluded": loaded.trials_excluded,
        "trials excluded by rule": sum(entry.trial is not None for entry in by_rule),
        "participants excluded by rule": len(
            {entry.participant for entry in by_rule if entry.trial is None}
        ),
    }


def trials_json(rows: tuple[TrialRow, ...], contrasts: TrialContrasts) -> list[Json]:
    """Return a record per trial that counts, with the contrast that each law predicts."""
    by_law = {law: values.tolist() for law, values in contrasts.by_law.items()}
    return [
        {
            "subject": row.participant,
            "session": row.session,
            "index": row.index,
            "kind": row.kind,
            "condition": row.condition,
            "level": row.level,
            "opposite": row.opposite,
            "place": row.place,
            "change": row.change,
            "agrees": row.agrees,
            "score": plain(row.score),
            "reaction_s": row.reaction_s,
            "measured": bool(contrasts.measured[number]),
            "predicted": {law: plain(values[number]) for law, values in by_law.items()},
        }
        for number, row in enumerate(rows)
    ]
