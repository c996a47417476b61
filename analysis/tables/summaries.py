"""Rows and columns that sum up the others: known by their names, or by their numbers."""

import re
import statistics
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import permutations

import numpy as np

from analysis.estimates import FloatArray
from analysis.tables.roles import plain
from analysis.tables.table_cells import Cells, is_missing

MEANS = frozenset(
    {
        "average", "comprehensive", "mean", "means", "total", "totals", "median", "mittelwert",
        "mittelwerte", "durchschnitt", "summe", "gesamt", "moyenne", "promedio", "stdev", "stddev",
        "standarddeviation", "standardabweichung", "stdabw", "écarttype", "desviaciónestándar",
        "sdn1", "stderr", "stderror", "standarderror", "standardfehler", "minimum", "maximum",
        "anzahl", "grandmean", "grandtotal", "overallmean", "subtotal", "meansd", "meansem",
        "meanse", "mwsd", "msd", "平均", "平均值", "均值", "平均数", "标准差", "標準差", "標準偏差",
        "合计", "合計", "总计", "總計", "总分", "总和", "最大值", "最小值", "中位数", "標準誤差",
        "标准误",
    }
)  # fmt: skip
"""Names that nobody has, and no condition."""
Statistic = Callable[[Sequence[float]], Sequence[float]]


def _means(values: Sequence[float]) -> Sequence[float]:
    return (statistics.fmean(values),)


def _deviations(values: Sequence[float]) -> Sequence[float]:
    """Return the standard deviation as it is estimated, and of these values alone."""
    if len(values) == 1:
        return (0.0,)
    return statistics.stdev(values), statistics.pstdev(values)


def _errors(values: Sequence[float]) -> Sequence[float]:
    return [deviation / len(values) ** 0.5 for deviation in _deviations(values)]


def _counts(values: Sequence[float]) -> Sequence[float]:
    return (float(len(values)),)


def _sums(values: Sequence[float]) -> Sequence[float]:
    return (sum(values),)


_SHORT: Mapping[str, Statistic] = {
    **dict.fromkeys(("m", "mw", "ø", "avg", "media"), _means),
    **dict.fromkeys(("sd", "std"), _deviations),
    **dict.fromkeys(("se", "sem"), _errors),
    **dict.fromkeys(("n", "count"), _counts),
    "sum": _sums,
    "all": lambda values: (statistics.fmean(values), sum(values)),
    "min": lambda values: (min(values),),
    "max": lambda values: (max(values),),
}
"""Names that may be initials, or conditions, too: their numbers tell."""
_LEAST = 2
_LEAST_OF_BOTH = 5


_AVERAGES = MEANS | {"m", "mw", "avg"}
_SPREADS = frozenset({"sd", "se", "sem", "std", "stdev", "stddev", "stderr"})


_DERIVED = frozenset(
    {
        "diff", "difference", "differenz", "delta", "ratio", "norm", "normalised", "normalized",
        "normiert", "pct", "percent", "z", "zscore",
    }
)  # fmt: skip
"""What is made of other columns, which it names."""
_DIFFERENCES = frozenset({"diff", "difference", "differenz", "ratio"})


def beside_scores(names: Sequence[str], lines: Sequence[Sequence[str]]) -> set[int]:
    """Return the places of columns that by their names tell of other columns, or of their forms.

    Such are `rough_sd`, `mean_rough` beside `rough_1` and `rough_2`, and of REDCap and Qualtrics
    `ratings_complete` and the total `SC0`; others are `z_dry` beside `dry`, and `Difference`.
    """
    words = [re.findall(r"[^\W_]+", re.sub(r"(?<=[^\W\d_A-Z])(?=[A-Z])", " ", at)) for at in names]
    stems = [re.sub(r"\d+$", "", plain(name)) for name in names]
    counted = Counter(stem for stem, name in zip(stems, names, strict=True) if stem != plain(name))
    own = {plain(name) for name in names}
    told: set[int] = set()
    for at, said in enumerate(words):
        for word, rest in ((said[:1], said[1:]), (said[-1:], said[:-1])):
            of = plain("".join(rest))
            is_average = plain("".join(word)) in _AVERAGES and counted[of] > 1
            is_spread = plain("".join(word)) in _SPREADS and of and not of.isdigit()
            made = plain("".join(word))
            is_derived = made in _DERIVED if of in own else not of and made in _DIFFERENCES
            if is_average or is_spread or is_derived:
                told.add(at)
        form = names[at].endswith("_complete") and {"0", "1", "2"}.issuperset(
            filter(None, lines[at])
        )
        if form or names[at] == "SC0":
            told.add(at)
    return told if len(told) < len(names) else set()


def may_sum_up(name: str) -> bool:
    return plain(name) in MEANS or plain(name) in _SHORT


def have_codes(names: Sequence[str]) -> bool:
    """Return whether all names that may be of subjects alone have a digit."""
    own = [name for name in names if not (may_sum_up(name) or is_missing(name))]
    return bool(own) and all(any(map(str.isdigit, name)) for name in own)


def summing_up(
    cells: Cells,
    names: Sequence[str],
    lines: Sequence[Sequence[str]],
    *,
    are_codes: bool = False,
) -> frozenset[int]:
    """Return the places of the lines - rows, or columns - that sum up those before them.

    They are called so; those with a short name stand at the end, and what they hold is the
    statistic of that name, to its printed digits - or all others have codes for names, with a
    digit, as is known of subjects (`are_codes`). A last one without a name is the mean or the sum.
    """
    if not any(map(may_sum_up, names)) and not (are_codes and names and is_missing(names[-1])):
        return frozenset()
    are_codes = are_codes and have_codes(names)
    named: set[int] = set()
    last: dict[int, list[float | None]] = {}
    others: list[list[float | None]] = []
    for at, (name, texts) in enumerate(zip(names, lines, strict=True)):
        numbers = [cells.number(text) for text in texts]
        statistic = _SHORT.get(plain(name))
        is_last = at == len(names) - 1
        if plain(name) in MEANS:
            named.add(at)
        elif (statistic and (are_codes or _is_that(statistic, texts, numbers, others))) or (
            is_missing(name) and is_last and _meets(_SHORT["all"], texts, numbers, others)
        ):
            last[at] = numbers
        else:
            others += [*last.values(), numbers]
            last.clear()
    return frozenset({*named, *last})


def _is_that(
    statistic: Statistic,
    texts: Sequence[str],
    numbers: Sequence[float | None],
    others: Sequence[Sequence[float | None]],
) -> bool:
    """Return whether numbers are the statistic of the others, and not by chance.

    A fraction, where all others are whole, is proof; else it takes five others and cells, two of
    each at least.
    """
    telling = _meets(statistic, texts, numbers, others)
    whole = all(value is None or value % 1 == 0 for other in others for value in other)
    proof = whole and any(number is not None and number % 1 for number in numbers)
    least = min(len(others), telling)
    return telling > 0 and (proof or (least >= _LEAST and len(others) + telling >= _LEAST_OF_BOTH))


def _meets(
    statistic: Statistic,
    texts: Sequence[str],
    numbers: Sequence[float | None],
    others: Sequence[Sequence[float | None]],
) -> int:
    """Return how many numbers are the statistic of others that differ, 0 if one is not."""
    decimals = [len(mark[1]) for text in texts if (mark := re.search(r"[.,](\d+)$", text))]
    near = max(0.51 * 10 ** -max(decimals), 1e-6) if decimals else 1e-6
    telling = 0
    for at, (text, number) in enumerate(zip(texts, numbers, strict=True)):
        if number is None and is_missing(text):
            continue
        values = [value for other in others if (value := other[at]) is not None]
        if number is None or not values:
            return 0
        if all(abs(number - value) > near for value in statistic(values)):
            return 0
        telling += len(set(values)) > 1
    return telling


# Columns and rows of a table of numbers that sum up the others, by their values.

LEAST_OTHERS = 3
LEAST_ROWS = 3
LEAST_SUMS = 2
LEAST_DIFFERENT = 4
# Each may be off by half of the last digit; the rest allows for binary fractions.
_PRINTED, _TENTHS = 0.0101, 0.0501
"""How far two means to two decimals may lie apart that were the same before rounding, and how far
one to one decimal may lie from what it was."""


_ROUNDED = 1e-9
"""What rounding may leave of a difference that is none."""


def numbers_in(cells: Cells, lines: Sequence[Sequence[str]]) -> FloatArray:
    """Return the numbers in lines - columns, or rows - NaN where there is none, a column each."""
    numbers = [[cells.number(text) for text in line] for line in lines]
    return np.array(numbers, dtype=np.float64).reshape(len(lines), -1 if lines else 0).T


def mean_column(scores: FloatArray) -> int | None:
    """Return the column that is the mean of all others in every row, None if none is.

    It takes at least three others and three rows in which they differ: in fewer, and where all are
    equal, scores meet their mean by chance. A value that only a mean can have - a fraction, where
    all others are whole - is proof in a single row. `scores` has shape (rows, columns), NaN where
    none was given.
    """
    if scores.shape[1] <= LEAST_OTHERS:
        return None
    given = ~np.isnan(scores)
    values = np.where(given, scores, 0.0)
    # Arrays of one entry per cell, about the others in its row: their number, mean and range.
    others = given.sum(axis=1, keepdims=True) - given
    there = others > 0
    means = (values.sum(axis=1, keepdims=True) - values) / np.maximum(others, 1)
    near = np.abs(values - means) <= _tolerance(values)
    met = np.where(there, given & near, ~given)
    telling = there & (_highest_of_others(scores) > -_highest_of_others(-scores))
    fractions = (values % 1 > 0).sum(axis=0)
    proof = (fractions > 0) & (fractions == fractions.sum())
    is_mean = met.all(axis=0) & there.any(axis=0) & (proof | (telling.sum(axis=0) >= LEAST_ROWS))
    return int(np.argmax(is_mean)) if is_mean.any() else None


def _tolerance(values: FloatArray) -> FloatArray:
    """Return how far each column may lie from what it is before rounding, by its decimals."""
    in_tenths = (np.abs(values * 10 - np.round(values * 10)) < 1e-6).all(axis=0)
    in_tenths &= (values % 1 > 0).any(axis=0)
    return np.where(in_tenths, _TENTHS, _PRINTED)


def summing_column(scores: FloatArray) -> tuple[int, str] | None:
    """Return the column that sums up all others in every row, and how.

    It is any that is their mean, or the last if it is their sum or standard deviation. A sum says
    something where it is higher than each of the others.
    """
    if (mean := mean_column(scores)) is not None:
        return mean, "the mean of all others"
    if scores.shape[1] <= LEAST_OTHERS:
        return None
    others, last = scores[:, :-1], scores[:, -1]
    given = ~np.isnan(others)
    many = given.sum(axis=1)
    values = np.where(given, others, 0.0)
    sums = values.sum(axis=1)
    squares = np.where(given, (others - (sums / np.maximum(many, 1))[:, None]) ** 2, 0.0).sum(
        axis=1
    )
    near = _tolerance(np.nan_to_num(last))
    is_higher = last > np.where(given, others, -np.inf).max(axis=1) + _PRINTED
    for word, statistic, tells in (
        ("sum", sums, is_higher),
        ("standard deviation", np.sqrt(squares / np.maximum(many - 1, 1)), squares > _ROUNDED),
        ("standard deviation", np.sqrt(squares / np.maximum(many, 1)), squares > _ROUNDED),
    ):
        met = np.abs(last - statistic) <= near
        telling = met & tells & (many > 1)
        if (met | np.isnan(last)).all() and telling.sum() >= LEAST_SUMS:
            return scores.shape[1] - 1, f"the {word} of all others"
    return None


def _highest_of_others(scores: FloatArray) -> FloatArray:
    """Return for each cell the highest of the other scores in its row, -inf if there is none."""
    known = np.where(np.isnan(scores), -np.inf, scores)
    # It is the row's highest score, except for the highest itself, whose others begin at the
    # second.
    second, first = np.partition(known, -2, axis=1)[:, -2:].T[:, :, None]
    return np.where(known == first, second, first)


def difference_column(scores: FloatArray) -> tuple[int, int, int] | None:
    """Return the last column if it is in every row the difference of two others, and which two.

    Rows without a number tell nothing, nor do those where the two are alike: it takes four others.
    It alone is negative somewhere: else one of the two may be the difference.
    """
    last = scores[:, -1]
    if not (last < 0).any() or (scores[:, :-1] < 0).any():
        return None
    near = _tolerance(np.nan_to_num(last))
    for one, other in permutations(range(scores.shape[1] - 1), 2):
        difference = scores[:, one] - scores[:, other]
        known = ~np.isnan(difference) & ~np.isnan(last)
        met = np.abs(last - difference) <= near
        if met[known].all() and (known & (difference != 0)).sum() >= LEAST_DIFFERENT:
            return scores.shape[1] - 1, one, other
    return None


def is_mean_of(line: FloatArray, scores: FloatArray) -> bool:
    """Return whether a column is, in every row, the mean of the others; `scores` has theirs."""
    given = ~np.isnan(scores)
    many = given.sum(axis=1)
    means = np.where(given, scores, 0.0).sum(axis=1) / np.maximum(many, 1)
    near = _tolerance(np.nan_to_num(line))
    met = np.where(many > 0, np.abs(line - means) <= near, np.isnan(line))
    # A row tells if its scores differ: else the column may be one more of them.
    filled = np.where(given, scores, means[:, None])
    telling = filled.max(axis=1) > filled.min(axis=1) + _ROUNDED
    return bool(met.all() and (met & telling).sum() >= LEAST_ROWS)
