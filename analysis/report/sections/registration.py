"""The section on the registration: its results, the deviations, and the calibrations in force."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import permutations
from math import exp, log

import numpy as np

from analysis.estimates import LEVEL, Json, NotEstimable, plain
from analysis.loading.sessions import is_scored
from analysis.loading.study_lock import StudyLock
from analysis.report import results as in_words
from analysis.report.blocks import Block, Column, Items, Section, Table, at, columns
from analysis.report.findings import Findings
from analysis.report.wording import interval, number, p_equals, place_of
from analysis.sensitivity.integration import LEAST_EFFECTIVE
from analysis.statistics.omnibus import LEAST_SHUFFLES, MOST_SHUFFLES
from analysis.statistics.omnibus import SEED as SHUFFLED_BY
from analysis.statistics.signed_rank import LARGEST_EXACT, signed_rank
from analysis.trials.contrasts import FORCE_STEP, FREQUENCY_DIGITS, PLACE_STEP_M, trial_contrasts
from device.friction.changes import LAW, RUNG
from protocol.journal.shared_form import UNKNOWN_UTC
from protocol.registration import registration as hypothesis
from protocol.registration.deviations import PAPER, Conduct, Deviation, deviations

# The settings of the analysis that a registration fixes beside the study file.


def analysis_settings(least: float = 0) -> dict[str, str | float]:
    """Return what this version's tests and estimates depend on, by name.

    Every value is a text or a number, so that a registration can hold it. `least` is the lowest
    score of the scale; where it is 0 the words stay, since a registration's digest depends on them.
    """
    zero = "as zero" if least == 0 else "as the lowest score of the scale"
    lowest = "as the lowest score" if least == 0 else "as the lowest score given"
    return {
        "significance level": LEVEL,
        "omnibus test": "Friedman, corrected for ties; exact by enumeration, else Monte Carlo; "
        "Skillings–Mack where scores are missing",
        "pairwise test": "Wilcoxon signed rank, two-sided, zeros dropped",
        "correction of pairwise tests": "Holm, over all pairs",
        "differences tested exactly": LARGEST_EXACT,
        "permutations, fewest": LEAST_SHUFFLES,
        "permutations, most": MOST_SHUFFLES,
        "permutations, seed": SHUFFLED_BY,
        "score of a condition": "mean over a participant's scored trials",
        "withheld scores": f"missing; beside it read {zero} and {lowest}",
        "sensitivity model": "M2, ordinal mixed model, integrated over its variances",
        "effective points of the integration, fewest": LEAST_EFFECTIVE,
        "measured force, step relative to the planned one": FORCE_STEP,
        "measured place, step in m": PLACE_STEP_M,
        "measured frequency, digits relative to the resonance": FREQUENCY_DIGITS,
    }


# The registered hypotheses with their results, and whether each result was registered.


@dataclass(frozen=True, kw_only=True)
class NamedResult:
    """The result of a registered hypothesis.

    `supported` is None where it cannot be computed; `found` says why, or what was found. A
    secondary hypothesis is supported only if the primary one is, so that without any effect one of
    them is supported in 5% of studies at most.
    """

    name: str
    primary: bool
    found: str
    p: float | None
    supported: bool | None
    estimated: bool = False

    @property
    def verdict(self) -> str:
        """Return the verdict in words."""
        if self.supported is None:
            # Nothing is claimed of a single threshold.
            return "estimated" if self.estimated else "not known"
        return "supported" if self.supported else "not supported"


def named_results(found: Findings, lock: StudyLock) -> list[NamedResult]:
    """Return the results of the registered hypotheses, the primary one first."""
    results, estimated = [], {hypothesis.threshold_of(track.name) for track in found.study.track}
    for name in lock.registration.hypotheses:
        made = _computed(found, lock, name)
        told, p, supported = (made.reason, None, None) if isinstance(made, NotEstimable) else made
        results.append(
            NamedResult(
                name=name,
                primary=name == lock.registration.primary,
                found=told,
                p=p,
                supported=supported,
                estimated=name in estimated,
            )
        )
    # A registration names its primary hypothesis first.
    first, *others = results
    return [first, *(gated(first, other) for other in others)]


def gated(primary: NamedResult, other: NamedResult) -> NamedResult:
    """Return the result of a secondary hypothesis, which counts only after the primary one."""
    # Gatekeeping needs no further correction: a secondary one cannot be supported unless the
    # primary one is.
    if primary.supported or not other.supported:
        return other
    why = "does not count, because the primary hypothesis is not supported"
    return replace(other, primary=False, found=f"{other.found}; {why}", supported=False)


_Computed = tuple[str, float | None, bool | None]
"""What was found, p, and whether it supports the hypothesis."""


def _computed(found: Findings, lock: StudyLock, name: str) -> _Computed | NotEstimable:
    if name == hypothesis.OMNIBUS:
        return _tested(found.table.main.omnibus_p)
    if name == hypothesis.GAINS:
        return _tested(at(found.table, "heterogeneity.p"))
    if name == hypothesis.FOLLOWS:
        return _gain(found)
    if name == hypothesis.ORDER:
        return _order(found, lock.registration.law)
    if name.endswith(hypothesis.NOTICED):
        return _noticed(found, name.removesuffix(hypothesis.NOTICED).strip())
    return (
        _of_weber(found, name)
        or _of_tracks(found, name)
        or _of_factors(found, name)
        or _of_groups(found, name)
        or _pair(found, name)
    )


def _of_tracks(found: Findings, name: str) -> _Computed | NotEstimable | None:
    """Return what was found of one threshold or of two; None where the name is of neither."""
    made, tracks = found.thresholds, [track.name for track in found.study.track]
    logs = {
        track: {
            each.participant: log(each.threshold)
            for each in (made.people if made else ())
            if each.track == track and each.threshold > 0
        }
        for track in tracks
    }
    for each in made.cohort if made else ():
        if name == hypothesis.threshold_of(each.track):
            if isinstance(each.threshold, NotEstimable):
                return each.threshold
            told = f"{number(each.threshold, 3)} {each.unit}".strip()
            if not isinstance(each.threshold_interval, NotEstimable):
                told += f", 95% CI {interval(each.threshold_interval, 3)}"
            return told, None, None
    for higher, lower in permutations(tracks, 2):
        if name == hypothesis.threshold_of(higher, lower):
            both = [who for who in logs[higher] if who in logs[lower]]
            differences = np.array([logs[higher][who] - logs[lower][who] for who in both])
            test = signed_rank(differences)
            if isinstance(test, NotEstimable):
                return test
            ratio = exp(differences.mean())
            told = f"ratio {number(ratio, 2)}, {p_equals(test.p)}"
            return told, test.p, ratio > 1 and test.p < LEVEL
    return (
        NotEstimable("nobody has a threshold")
        if name in map(hypothesis.threshold_of, tracks)
        else None
    )


def _of_weber(found: Findings, name: str) -> _Computed | NotEstimable | None:
    """Return whether a Weber fraction is below its limit; None where the name is of no such."""
    if (limited := hypothesis.weber_below(name)) is None:
        return None
    track, limit = limited
    cohort = found.thresholds.cohort if found.thresholds else ()
    each = next((each for each in cohort if each.track == track), None)
    if each is None or isinstance(each.weber, NotEstimable):
        return NotEstimable("nobody's Weber fraction is known")
    ends = each.weber_interval
    if isinstance(ends, NotEstimable):
        return ends
    told = f"{number(each.weber, 3)} ({each.weber_of} friction), 95% CI {interval(ends, 3)}"
    # An interval decides, so that there is no p.
    return told, None, ends[1] < limit


def _of_factors(found: Findings, name: str) -> _Computed | NotEstimable | None:
    """Return the effect of a factor or of two; None where the name is of no such hypothesis."""
    tests = found.trials.factorial
    for it in tests.effects if tests else ():
        if name in {hypothesis.effect_of(*it.factors), hypothesis.effect_of(*reversed(it.factors))}:
            return _tested(at(it.effect, "p"))
    return None


def _tested(p: float | NotEstimable) -> _Computed | NotEstimable:
    return p if isinstance(p, NotEstimable) else (p_equals(p), p, p < LEVEL)


def _gain(found: Findings) -> _Computed | NotEstimable:
    fit = found.trials.m2
    if isinstance(fit, NotEstimable):
        return fit
    ends = fit.lines.gain_interval
    if not fit.lines.group_known:
        return NotEstimable("a single participant tells nothing about a group")
    # A posterior interval decides, so that there is no p.
    return f"gain {number(fit.lines.gain, 2)}, 95% CI {interval(ends)}", None, ends[0] > 0


def _order(found: Findings, law: str) -> _Computed | NotEstimable:
    order = found.trials.orders.get(law)
    if order is None or isinstance(order, NotEstimable):
        return NotEstimable("too few conditions with a prediction")
    rho, p = order.spearman, order.p
    if isinstance(rho, NotEstimable):
        return rho
    if isinstance(p, NotEstimable):
        return p
    # Two-sided p, so that an order against the law must not count for it.
    return f"ρ = {number(rho, 2)}, {p_equals(p)}", p, rho > 0 and p < LEVEL


def _noticed(found: Findings, condition: str) -> _Computed | NotEstimable:
    """Return the test of a condition, or of all together if it has no name."""
    for each in found.trials.noticed:
        if each.of.get("condition", "") == condition:
            if isinstance(each.found, NotEstimable):
                return each.found
            # That of all conditions needs no correction.
            p = each.found.p if each.p_holm is None else each.p_holm
            told = f"d′ = {number(each.found.d_prime, 2)}, {p_equals(p)}"
            return f"{told}{' (Holm)' * bool(condition)}", p, p < LEVEL
    return NotEstimable("there are no such trials to compare with catch trials")


def _pair(found: Findings, name: str) -> _Computed | NotEstimable:
    for pair in found.table.main.pairwise:
        # Tests know a pair in one order, a hypothesis may name it in the other.
        for higher, lower, sign in ((pair.a, pair.b, 1), (pair.b, pair.a, -1)):
            if name == hypothesis.above(higher, lower):
                if isinstance(pair.test, NotEstimable):
                    return pair.test
                by, p = sign * pair.test.mean_difference, pair.p_holm
                if isinstance(p, NotEstimable):
                    return p
                told = f"mean difference {number(by, 2)}, {p_equals(p)} (Holm)"
                return told, p, by > 0 and p < LEVEL
    return NotEstimable("these conditions have no scores to compare")


def _of_groups(found: Findings, name: str) -> _Computed | NotEstimable | None:
    """Return the result of a hypothesis on two groups; None if it is about something else."""
    if name not in {hypothesis.between(a, b) for a, b in permutations(found.study.groups, 2)}:
        return None
    score = NotEstimable("no group has a score") if found.groups is None else found.groups.score
    if isinstance(score, NotEstimable):
        return score
    for pair in score.pairs:
        for higher, lower, sign in ((pair.a, pair.b, 1), (pair.b, pair.a, -1)):
            if name == hypothesis.between(higher, lower):
                told = f"shift {number(sign * pair.shift, 2)}, {p_equals(pair.p_holm)} (Holm)"
                return told, pair.p_holm, sign * pair.shift > 0 and pair.differs
    return NotEstimable("these groups have no scores to compare")


def marked(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield the results in words; those of a registered study say whether they were registered."""
    lock = found.loaded.lock
    if lock is None:
        yield from in_words.paragraphs(found)
        return
    names = lock.registration.hypotheses
    # Every other hypothesis is of a pair of conditions; no paragraph answers that on gains.
    asked = {
        hypothesis.OMNIBUS: in_words.DIFFER,
        hypothesis.GAINS: "",
        hypothesis.FOLLOWS: in_words.FOLLOW,
        hypothesis.ORDER: in_words.ORDERED,
    }
    asked |= {
        hypothesis.between(a, b): in_words.GROUPS for a, b in permutations(found.study.groups, 2)
    }
    asked |= {name: in_words.NOTICE for name in names if name.endswith(hypothesis.NOTICED)}
    asked |= dict.fromkeys(
        set(names) & set(hypothesis.hypotheses_of_tracks(found.study.track, names)),
        in_words.THRESHOLDS,
    )
    asked |= dict.fromkeys(
        hypothesis.hypotheses((), (), hypothesis.factors_of(found.study)).keys() - asked,
        in_words.FACTORS,
    )
    secondary = f", {', '.join(lock.registration.secondary)}" * bool(lock.registration.secondary)
    yield (
        "What was registered?",
        f"Registered: {lock.registration.primary} (primary){secondary}. Not registered: every "
        "other result on this page. Section Registration has the results of what was registered, "
        "and all deviations.",
    )
    for question, answer in in_words.paragraphs(found):
        registered = ", ".join(
            name for name in names if asked.get(name, in_words.WHICH) == question
        )
        yield (
            f"{question} ({f'registered: {registered}' if registered else 'not registered'})",
            answer,
        )


def section(found: Findings) -> Section:
    """Return what was registered and how it came out; nothing for a study without registration."""
    lock = found.loaded.lock
    if lock is None:
        return Section()
    results = named_results(found, lock)
    departed = deviations(lock.registration, conduct(found, lock))
    later = _later_contrasts(found)
    # A data set does not tell the time of the registration.
    when = f" at {lock.utc:%Y-%m-%d %H:%M} UTC" if lock.utc > UNKNOWN_UTC else ""
    return Section(
        title="Registration",
        blocks=[
            f"Plan and analysis were registered{when} with touchbeam "
            f"{lock.registration.touchbeam}, before the first session. The digest of the "
            f"registration, SHA-256 {lock.registration.digest}, seeded every order; touchbeam "
            "verify draws them again. Not registered: every result that this table does not name.",
            Table.over(
                results,
                [
                    Column("hypothesis", "name", kind="text"),
                    Column(
                        "rank", lambda it: "primary" if it.primary else "secondary", kind="text"
                    ),
                    Column("result", "found", kind="text"),
                    Column("verdict", "verdict", kind="text"),
                ],
                name="registered",
                caption="Registered hypotheses. Secondary ones count only if the primary one is "
                "supported.",
            ),
            Items(
                name="deviations",
                heading="Deviations from the registration",
                lines=[f"{kind}: {text}" for kind, text in departed],
            )
            if departed
            else "The study did not deviate from its registration.",
            _calibrations(lock),
            _later_table(later, found.origin.later.origin if found.origin.later else ""),
        ],
        data={"registration": _record(lock, results, departed, later)},
    )


def registered_lines(found: Findings) -> Iterator[str]:
    """Yield for the terminal what was registered, how it came out, and the deviations."""
    lock = found.loaded.lock
    if lock is not None:
        for result in named_results(found, lock):
            yield f"Registered: {result.name}: {result.verdict} ({result.found})"
        for kind, text in deviations(lock.registration, conduct(found, lock)):
            yield f"Deviation: {kind}: {text}"


def conduct(found: Findings, lock: StudyLock) -> Conduct:
    """Return how the study was conducted and is reported here."""
    origin = found.origin
    # What the rules of the study file take out was registered with that file.
    left_out = [entry for entry in found.loaded.left_out if entry.by != "rule"]
    return Conduct(
        sessions=lock.sessions,
        amendments=lock.amendments,
        participants=lock.completed,
        groups=lock.groups,
        by_hand=[f"{place_of(entry)}: {entry.why}" for entry in left_out],
        withdrawn=found.loaded.sessions_withdrawn,
        withdrawn_completed=found.loaded.withdrawn_completed,
        study_sha256=origin.study_sha256,
        law=LAW,
        rung=RUNG,
        analysis=analysis_settings(found.rating.minimum),
        touchbeam=version("touchbeam"),
        later=origin.later.origin if origin.later else "",
        broken_file=origin.unlocked,
    )


def _calibrations(lock: StudyLock) -> Block:
    """Return under which calibration each session predicts, if any rig was calibrated."""
    if not any(run.calibration for run in lock.sessions):
        return None
    by_rig: dict[str, list[str]] = {}
    for run in lock.sessions:
        by_rig.setdefault(run.calibration or PAPER, []).append(run.name)
    return Table(
        name="calibrations",
        caption="The calibration in force at each session, under which its trials are predicted.",
        columns=columns("calibration", "sessions", kind="text"),
        rows=[[rig, ", ".join(names)] for rig, names in by_rig.items()],
    )


_Later = dict[str, tuple[float, float]]
"""Mean predicted contrast by condition: as registered, and under a later calibration."""


def _later_contrasts(found: Findings) -> _Later:
    if found.origin.later is None:
        return {}
    loaded = found.loaded
    # Without the rigs in force, each trial is predicted on the one that is passed.
    trials = loaded.trials.assign(rig=None)
    anew = trial_contrasts(found.study, trials, loaded.touches, found.origin.later).by_law[LAW]
    before = found.trials.contrasts.by_law[LAW]
    scored, names = is_scored(trials).to_numpy(), trials["condition"].to_numpy()
    chosen = {name: scored & (names == name) for name in loaded.table.conditions}
    return {
        name: (float(np.mean(before[rows])), float(np.mean(anew[rows])))
        for name, rows in chosen.items()
        if rows.any()
    }


def _later_table(later: _Later, origin: str) -> Table | None:
    if not later:
        return None
    return Table(
        name="later-calibration",
        caption="Mean predicted contrast under the calibration in force, and, not registered, "
        f"under a later one ({origin}); law {LAW}.",
        columns=[
            Column("condition", kind="text"),
            *columns("in force (registered)", "later (not registered)"),
        ],
        rows=[[name, number(before), number(anew)] for name, (before, anew) in later.items()],
    )


def _record(
    lock: StudyLock, results: list[NamedResult], departed: list[Deviation], later: _Later
) -> Json:
    settled = lock.registration
    return {
        "digest": settled.digest,
        "utc": lock.utc.isoformat() if lock.utc > UNKNOWN_UTC else None,
        "primary": settled.primary,
        "secondary": list(settled.secondary),
        "results": [plain(each) for each in results],
        "deviations": [each._asdict() for each in departed],
        "law": settled.law,
        "rung": settled.rung,
        "participants": {"registered": settled.participants, "completed": lock.completed},
        "calibrations": {run.name: run.calibration or PAPER for run in lock.sessions},
        "later_calibration": {
            name: {"in_force": plain(before), "later": plain(anew)}
            for name, (before, anew) in later.items()
        },
    }
