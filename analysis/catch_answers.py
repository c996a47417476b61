"""Change or no change: what was answered on trials with a signal and on catch trials at 0 V."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.answered_trials import TrialRow
from analysis.no_answer import NoAnswer
from analysis.sensitivity.checks import Discrimination, discrimination
from protocol.questions import ANSWERS, no_change

_NO_CHANGE = frozenset(map(no_change, ANSWERS))


@dataclass(frozen=True, kw_only=True)
class CatchAnswers:
    """Answers to catch trials (0 V) and to signal trials, pooled and by subject."""

    overall: Discrimination | NoAnswer
    subjects: Mapping[str, Discrimination | NoAnswer]


def catch_answers(rows: Sequence[TrialRow]) -> CatchAnswers:
    """Return how often a change was reported with a signal (hits) and without (false alarms).

    Both rates count the same event, any answer but `same` or `not swapped`: a hit need not be in
    the expected direction, as a false alarm has none. A scored trial whose condition expects no
    change is neither.
    """
    hits, signals, alarms, catches = Counter[str](), Counter[str](), Counter[str](), Counter[str]()
    for row in rows:
        if row.change is None:
            continue
        if row.kind == "trial" and row.expected not in _NO_CHANGE:
            signals[row.participant] += 1
            hits[row.participant] += row.change not in _NO_CHANGE
        elif row.kind == "catch":
            catches[row.participant] += 1
            alarms[row.participant] += row.change not in _NO_CHANGE
    return CatchAnswers(
        overall=discrimination(
            (hits.total(), signals.total()),
            (alarms.total(), catches.total()),
            people=len(signals.keys() | catches.keys()),
        ),
        subjects={
            who: discrimination((hits[who], signals[who]), (alarms[who], catches[who]))
            for who in catches
        },
    )
