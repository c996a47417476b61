"""The section on the registration: its results, the deviations, and the calibrations in force."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np

from analysis.estimates import LEVEL, Json, NotEstimable, plain
from analysis.loading.sessions import is_scored
from analysis.loading.study_lock import StudyLock
from analysis.report import results as in_words
from analysis.report.blocks import Block, Column, Items, Section, Table, columns
from analysis.report.findings import Findings
from analysis.report.hypotheses import Hypothesis, registered
from analysis.report.wording import number, place_of
from analysis.sensitivity.integration import LEAST_EFFECTIVE
from analysis.statistics.factorial import MOST_ARRANGEMENTS
from analysis.statistics.factorial import MOST_SHUFFLES as FACTOR_SHUFFLES
from analysis.statistics.omnibus import LEAST_SHUFFLES, MOST_SHUFFLES
from analysis.statistics.omnibus import SEED as SHUFFLED_BY
from analysis.statistics.signed_rank import LARGEST_EXACT
from analysis.statistics.slope import MOST_CONDITIONS, SHUFFLES
from analysis.trials.contrasts import FORCE_STEP, FREQUENCY_DIGITS, PLACE_STEP_M, trial_contrasts
from device.friction.changes import LAW, RUNG
from device.friction.rungs import present_name
from protocol.errors import listed
from protocol.journal.events import UNKNOWN_UTC
from protocol.registration.deviations import PAPER, Conduct, Deviation, deviations
from protocol.registration.registration import SCHEMA

# The settings of the analysis that a registration fixes beside the study file.


def analysis_settings(schema: int = SCHEMA) -> dict[str, str | float]:
    """Return what this version's tests and estimates depend on, by name.

    Every value is a text or a number, so that a registration can hold it. Under schema 1 these are
    the settings, by the names of touchbeam 1, with which its registered tests are done today.
    """
    shuffles: dict[str, str | float] = {
        "differences tested exactly": LARGEST_EXACT,
        "permutations, fewest": LEAST_SHUFFLES,
        "permutations, most": MOST_SHUFFLES,
        "permutations, seed": SHUFFLED_BY,
    }
    of_scores = {
        "omnibus test": "Friedman, corrected for ties; exact by enumeration, else Monte Carlo; "
        "Skillings–Mack where scores are missing",
        "pairwise test": "Wilcoxon signed rank, two-sided, zeros dropped",
        "correction of pairwise tests": "Holm, over all pairs",
        **shuffles,
        "score of a condition": "mean over a participant's scored trials",
        "withheld scores": "missing",
    }
    of_responses = {
        "response of a trial": "score - lowest score + 1 if the change was answered as expected, 0 "
        "if it was answered otherwise; the score where no change was asked for",
        "response of a condition": "mean over a participant's answered trials",
        "omnibus test": "Friedman of responses, corrected for ties; exact by enumeration, else "
        "Monte Carlo; Skillings–Mack where responses are missing",
        "pairwise test": "Wilcoxon signed rank of responses, two-sided, zeros dropped",
        "correction of pairwise tests": "Holm, over all pairs",
        **shuffles,
        "test of the prediction": "slope of responses on predicted contrasts, permuted over the "
        "conditions",
        "conditions whose contrasts are permuted exactly": MOST_CONDITIONS,
        "permutations of contrasts": SHUFFLES,
        "tests of factors": "permutation of levels within participants, of ranks of responses for "
        "main effects and of responses for interactions, and F of these with Greenhouse and "
        "Geisser's correction; the larger p",
        "arrangements of levels listed, most": MOST_ARRANGEMENTS,
        "shuffles of levels, most": FACTOR_SHUFFLES,
        "correction of the questions of a report": "Holm, over all that have an answer",
    }
    return {
        "significance level": LEVEL,
        **(of_scores if schema < SCHEMA else of_responses),
        "sensitivity model": "noticing (probit), then rating (ordinal mixed model) with a column "
        "for who noticed, integrated over their variances",
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
    them is supported in 5% of studies at most. One that was registered with a test that this
    version does not have is not `tested`; if that is the primary one, the secondary ones are not
    `protected`: each is supported by its own p.
    """

    name: str
    primary: bool
    found: str
    p: float | None
    supported: bool | None
    estimated: bool = False
    tested: bool = True
    protected: bool = True

    @property
    def verdict(self) -> str:
        if not self.tested:
            return "not tested"
        if self.supported is None:
            # Nothing is claimed of a single threshold.
            return "estimated" if self.estimated else "not known"
        return "supported" if self.supported else "not supported"


def _asked(found: Findings, lock: StudyLock) -> list[Hypothesis]:
    settled = lock.registration
    return registered(found.study, settled.hypotheses, settled.earlier)


def named_results(found: Findings, lock: StudyLock) -> list[NamedResult]:
    """Return the results of the registered hypotheses, the primary one first."""
    results = []
    for each in _asked(found, lock):
        made = each.judge(found)
        told, p, supported = (made.reason, None, None) if isinstance(made, NotEstimable) else made
        results.append(
            NamedResult(
                name=each.name,
                primary=each.name == lock.registration.primary,
                found=told,
                p=p,
                supported=supported,
                estimated=each.estimated,
                tested=each.tested,
            )
        )
    # A registration names its primary hypothesis first.
    first, *others = results
    return [first, *(gated(first, other) for other in others)]


def gated(primary: NamedResult, other: NamedResult) -> NamedResult:
    """Return the result of a secondary hypothesis, which counts only after the primary one."""
    if not primary.tested and other.supported is not None:
        why = "not protected by a primary hypothesis"
        return replace(other, protected=False, found=f"{other.found}; {why}")
    # Gatekeeping needs no further correction: a secondary one cannot be supported unless the
    # primary one is.
    if primary.supported or not other.supported:
        return other
    why = "does not count, because the primary hypothesis is not supported"
    return replace(other, primary=False, found=f"{other.found}; {why}", supported=False)


def marked(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield the results in words; those of a registered study say whether they were registered."""
    lock = found.loaded.lock
    if lock is None:
        yield from ((found.in_measure(of), told) for of, told in in_words.paragraphs(found))
        return
    asked = _asked(found, lock)
    secondary = f", {listed(lock.registration.secondary)}" * bool(lock.registration.secondary)
    yield (
        "What was registered?",
        f"Registered: {lock.registration.primary} (primary){secondary}. Not registered: every "
        "other result on this page. Section Registration has the results of what was registered, "
        "and all deviations.",
    )
    for question, answer in in_words.paragraphs(found):
        there = [each for each in asked if each.question == question]
        names = {
            how: listed(each.name for each in there if each.as_on_page is same)
            for how, same in (("registered", True), ("registered with another test", False))
        }
        marks = [f"{how}: {of}" for how, of in names.items() if of]
        yield f"{found.in_measure(question)} ({'; '.join(marks) or 'not registered'})", answer


_WITH_ITS_TESTS = (
    "This registration names tests of touchbeam 1. They compare scores, not responses, and are "
    "done here as registered, so that their results may differ from those of the "
    "same name elsewhere."
)
_GATED = "Secondary ones count only if the primary one is supported."
_UNGATED = (
    "The primary one is not tested, so that nothing protects the secondary ones: each is judged by "
    "its own test, and the more there are, the likelier is a false one among them."
)


def section(found: Findings) -> Section:
    """Return what was registered and how it came out; nothing for a study without registration."""
    lock = found.loaded.lock
    if lock is None:
        return Section()
    results = named_results(found, lock)
    departed = deviations(lock.registration, conduct(found, lock))
    later = _later_contrasts(found)
    # A journal that was imported from a data set does not tell the time of the registration.
    when = f" at {lock.utc:%Y-%m-%d %H:%M} UTC" if lock.utc > UNKNOWN_UTC else ""
    return Section(
        title="Registration",
        blocks=[
            f"Plan and analysis were registered{when} with touchbeam "
            f"{lock.registration.touchbeam}, before the first session. The digest of the "
            f"registration, SHA-256 {lock.registration.digest}, seeded every order. Not "
            "registered: every result that this table does not name.",
            _WITH_ITS_TESTS if lock.registration.earlier else None,
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
                caption=f"Registered hypotheses. {_GATED if results[0].tested else _UNGATED}",
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
        if earlier := lock.registration.earlier:
            yield f"Registered with touchbeam {earlier}: its tests, of scores, are done as then."
        for result in named_results(found, lock):
            yield f"Registered: {result.name}: {result.verdict} ({result.found})"
        for kind, text in deviations(lock.registration, conduct(found, lock)):
            yield f"Deviation: {kind}: {text}"


def conduct(found: Findings, lock: StudyLock) -> Conduct:
    """Return how the study was conducted and is reported here."""
    origin, registered = found.origin, lock.registration.rung
    # What the rules of the study file take out was registered with that file.
    left_out = [entry for entry in found.loaded.left_out if entry.by == "operator"]
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
        # Of several names of one rung, that which was registered.
        rung=registered if present_name(registered) == RUNG else RUNG,
        analysis=analysis_settings(lock.registration.schema),
        untested=[each.name for each in _asked(found, lock) if not each.tested],
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
        "schema": settled.schema,
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
