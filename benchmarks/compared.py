"""A comparison: our work beside a peer, or a physical floor, in turn in the same run."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median, quantiles
from typing import Any

KEY = "compared"
"""Under which a benchmark's extra information holds its comparison."""
WORK = "work"
"""Under which it holds what was done, of a benchmark that is compared with nothing."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Times of the same work by touchbeam and by a peer; times in seconds.

    `low` and `high` are the quartiles of the ratios of neighbouring measurements, which the same
    load on the machine has met. `accuracy` says how far the result is off, where it can be.
    """

    work: str
    peer: str
    ours_s: float
    peer_s: float
    ratio: float
    low: float
    high: float
    accuracy: str = ""


def compare(
    benchmark: Any,
    work: str,
    peer: str,
    ours: Sequence[float],
    theirs: Sequence[float],
    accuracy: str = "",
) -> float:
    """Keep and print a comparison; return the ratio of the medians."""
    pairs = [mine / other for mine, other in zip(ours, theirs, strict=True)]
    low, _, high = quantiles(pairs, n=4) if len(pairs) > 1 else (pairs[0],) * 3
    found = Comparison(
        work=work,
        peer=peer,
        ours_s=median(ours),
        peer_s=median(theirs),
        ratio=median(ours) / median(theirs),
        low=low,
        high=high,
        accuracy=accuracy,
    )
    benchmark.extra_info[KEY] = vars(found)
    print(f"{work}: {found.ratio:.2f} of {peer} ({low:.2f} to {high:.2f})")
    return found.ratio


def tell(benchmark: Any, work: str, **facts: object) -> None:
    """Keep what was done, and what was measured beside its time: a name with `_` for blanks."""
    benchmark.extra_info.update({WORK: work, **facts})


def page(benchmarks: Sequence[Any], machine: str) -> str:
    """Return the table of a run's benchmarks as Markdown, and what else they measured."""
    compared = [found.extra_info[KEY] for found in benchmarks if KEY in found.extra_info]
    rows = "".join(_row(Comparison(**one)) for one in compared)
    others = "".join(
        f"| {found.extra_info[WORK]} | {_time(found.stats.median)} | {_facts(found.extra_info)} |\n"
        for found in benchmarks
        if WORK in found.extra_info
    )
    return (
        f"{_ABOUT}\nMeasured on: {machine}.\n\n"
        f"## Beside a peer, or a physical floor\n\n{_HEAD}{rows}"
        f"\n## Further figures\n\n| work | takes | also measured |\n|---|---|---|\n{others}"
    )


_ABOUT = """\
# Benchmarks

`make bench` measures and writes this page. A time alone says little about a program: another
machine, or another load, gives another time. So each piece of work is measured in turn with a
peer that does the same, or with the least that the work could cost, in the same run. **Ratio** is
the median time of touchbeam over the peer's; the range holds the middle half of the ratios of
neighbouring measurements. A ratio of 1.2 means that touchbeam takes 20% longer, 0.5 that it takes
half the time.

Peers are used where they do the same work: pySerial and PyVISA on the link, SQLite for the
journal, pandas for tables, a bare PsychoPy window, SciPy for the tests of scores and for integrals,
`np.sin` for the model, questplus for what a track asks next.
PyVISA writes each line by itself; over TCP the second of two writes waits until the first one is
acknowledged, some 40 ms.
"""
_HEAD = """\
| work | touchbeam | peer or floor | takes | ratio | range | accuracy |
|---|---|---|---|---|---|---|
"""


def _row(one: Comparison) -> str:
    spread = f"{_three(one.low)} to {_three(one.high)}"
    return (
        f"| {one.work} | {_time(one.ours_s)} | {one.peer} | {_time(one.peer_s)} "
        f"| {_three(one.ratio)} | {spread} | {one.accuracy or '–'} |\n"
    )


def _three(number: float) -> str:
    """Return a number with three significant digits, as people write it.

    >>> _three(1234.5), _three(0.0123456), _three(2.0)
    ('1,230', '0.0123', '2.00')
    """
    if number >= 100:
        return f"{float(f'{number:.3g}'):,.0f}"
    return f"{number:#.3g}"


def _time(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{_three(seconds / size).rstrip('.')} {unit}"
    return f"{_three(seconds / 1e-9)} ns"


def _facts(extra: dict[str, Any]) -> str:
    facts = {name: value for name, value in extra.items() if name not in {WORK, KEY}}
    return "; ".join(f"{name.replace('_', ' ')} {value}" for name, value in facts.items()) or "–"
