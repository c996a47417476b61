"""The preview of a cohort's plans as lines of text, for a terminal of 80 columns or more."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf, isfinite
from textwrap import wrap
from typing import get_args

from protocol.address import BAUD
from protocol.errors import listed
from protocol.plan.trials import Trial
from protocol.preview import preview
from protocol.proof.trial_checks import balance_guaranteed, by_group, carry_over, sequences
from protocol.study.languages import reference_texts
from protocol.study.participant_texts import scale_in_words
from protocol.study.rig_settings import ForceChannel
from protocol.study.rules import hours_in_words
from protocol.study.study import Study
from protocol.study.study_question import AskedIf, StudyQuestion, When


def preview_lines(shown: preview.Preview, model: preview.Prediction) -> Iterator[str]:
    """Yield the preview line by line: the first participant's trials, then the cohort."""
    yield f"Plan of the first of {_many(len(shown.plans), 'participant')} (session 1)"
    yield ""
    columns = [column for column in zip(*_trial_rows(shown, model), strict=True) if any(column[1:])]
    yield from _table(zip(*columns, strict=True))
    yield ""
    yield "Peak V: amplitude. Drive: relative to the resonance, or in Hz. 0.98/1: a change between"
    yield "touches; 0>200: a change during a touch."
    names = {heading for heading, *_ in columns}
    if "pred." in names:
        yield from _predicted(shown, model)
        yield f"{model.source or f'friction law {model.law}, rung {model.rung}'}."
    if model.rig:
        yield from wrap(f"Rig: {model.rig}.", 80)
    if "finger" in names:
        yield "Finger: what else changes between touches; x1.5: press 1.5 times as hard."
    yield ""
    yield from _session_lines(shown)
    yield from _question_lines(shown)
    yield from _language_lines(shown)
    if not shown.study.condition:  # no order of none
        return
    yield ""
    yield from _carryover_lines(shown)
    yield from _group_lines(shown.study)


def _predicted(shown: preview.Preview, model: preview.Prediction) -> Iterator[str]:
    """Yield what the predicted numbers are."""
    if not shown.study.absolute:
        yield "Pred.: predicted change of ln(friction), positive in the expected direction;"
        return
    yield f"Pred.: predicted ln(friction / {model.rest}), positive where friction rises;"
    if any(trial.expected for trial in shown.plans[0].trials):
        yield "where an answer is expected, its change, positive in the expected direction;"


def _many(number: int, one: str, more: str = "") -> str:
    return f"{number} {one if number == 1 else more or one + 's'}"


def _trial_rows(shown: preview.Preview, model: preview.Prediction) -> Iterator[tuple[str, ...]]:
    yield ("#", "block", "kind", "condition", "peak V", "drive", "pred.", "expected", "finger")
    for trial in shown.plans[0].trials:
        contrast = model.contrast(trial)
        yield (
            str(trial.index),
            str(trial.block) if trial.block else "",
            # Scored trials are the rule, so that only other kinds are named.
            "opposite" if trial.opposite else trial.kind.replace("trial", ""),
            trial.condition or (trial.track.name if trial.track else ""),
            # The voltage of a track's level follows from the answers.
            ""
            if trial.track
            else _courses((f"{t.voltage_v:g}", f"{t.end_voltage_v:g}") for t in trial.touches),
            _courses(touch.drive_ends for touch in trial.touches),
            "" if contrast is None else f"{contrast:+.3f}",
            trial.expected or "",
            _finger(trial, shown.study),
        )


def _finger(trial: Trial, shown: Study) -> str:
    """Return what else changes between touches: the direction, the pressure, beam and speed."""
    set_by = preview.levels(trial.touches)
    presses = [f"x{press:g}" for press in set_by["press"]]
    own = shown.touch
    beams = [str(beam or own.beam) for beam in set_by["beam"]]
    speeds = [f"{speed or own.sliding_speed_m_s:g} m/s" for speed in set_by["sliding_speed_m_s"]]
    courses = (set_by["direction"], presses, beams, speeds)
    return "; ".join("/".join(course) for course in courses if len(set(course)) > 1)


def _courses(ends: Iterable[tuple[str, str]]) -> str:
    """Return `0.98/1`, or `100` if all touches have the same value; `0>200` within a touch."""
    shown = [start if start == end else f"{start}>{end}" for start, end in ends]
    return shown[0] if len(set(shown)) == 1 else "/".join(shown)


def _table(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    cells = list(rows)
    widths = [max(_columns(row[place]) for row in cells) for place in range(len(cells[0]))]
    for row in cells:
        padded = (
            cell + " " * (width - _columns(cell)) for cell, width in zip(row, widths, strict=True)
        )
        yield "  ".join(padded).rstrip()


def _columns(text: str) -> int:
    """Return the terminal columns that `text` takes: a Chinese character takes two."""
    if text.isascii():
        return len(text)
    # Loaded only for names that are not ASCII, because `check` should start soon.
    from unicodedata import combining, east_asian_width

    return sum((east_asian_width(sign) in "WF") + (not combining(sign)) for sign in text)


def _question_lines(shown: preview.Preview) -> Iterator[str]:
    """Yield what the study itself asks and gives to read, by time; pages by their numbers."""
    asked: dict[str, list[str]] = {}
    for when in get_args(When):
        time = {"trial": "after trials", "block": "after blocks"}.get(when, when)
        asked[time] = [
            f"{it.name} (if {it.asked_if})" if it.asked_if else it.name
            for it in shown.study.questions(when)
        ]
    read: dict[str, list[str]] = {}
    for number, page in enumerate(shown.study.page, start=1):
        block = "every block" if page.block is None else f"block {page.block}"
        time = block if page.before == "block" else page.before.replace("session", "the session")
        picture = f" ({page.picture})" if page.picture else ""
        read.setdefault(f"before {time}", []).append(f"{number}{picture}")
    yield from _by_time("Questions", asked)
    yield from _by_time("Pages", read)


def _by_time(heading: str, shown: Mapping[str, Sequence[str]]) -> Iterator[str]:
    for time, names in shown.items():
        if names:
            yield f"{heading:<11} {time}: {listed(names)}"
            heading = ""


def _language_lines(shown: preview.Preview) -> Iterator[str]:
    for code, language in shown.study.languages.items():
        same = [key for key, text in reference_texts().items() if language.texts.get(key) == text]
        if same:
            first = ", ".join(same[:3]) + ", …" * (len(same) > 3)
            yield f"Language    {code}: {_many(len(same), 'text')} as in English: {first}"


def _session_lines(shown: preview.Preview) -> Iterator[str]:
    rig, trials = shown.study.rig, shown.plans[0].trials
    touches = sum(len(trial.touches) for trial in trials)
    scored = sum(trial.scored for trial in trials if trial.kind == "trial")
    swaps = "1 beam swap" if set(shown.swaps) == {1} else f"{_span(shown.swaps)} beam swaps"
    yield (
        f"Session     {_span([s / 60 for s in shown.durations_s])} min, "
        f"{_many(touches, 'touch', 'touches')}, {_many(scored, 'scored trial')}, {swaps}"
    )
    if shown.slide is not None:
        passes = _many(len(shown.slide.trials), "pass", "passes")
        yield f"Sliding     {passes} with touchbeam slide, {shown.slide_s / 60:.3g} min"
    yield from _recorded_lines(shown.study.force_channel)
    yield f"Amplitude   up to {shown.max_voltage_v:g} V (peak); limit {rig.max_voltage_v:g} V"
    follows = isfinite(shown.max_resonance_hz)  # else each drive is in Hz
    there = f" if the resonance is at {rig.nominal_resonance_hz:g} Hz" * follows
    limits = (f"limit {rig.max_frequency_hz:g} Hz", f"limit {rig.max_slew_v_per_us:g} V/us")
    yield f"Drive       up to {shown.max_frequency_hz:.0f} Hz{there}; {limits[0]}"
    yield f"Slew        up to {shown.max_slew_v_per_us:.1f} V/us; {limits[1]}"
    ends = f"above {shown.max_resonance_hz:.0f} Hz a limit would end the session"
    told = ends if follows else "no drive follows it"
    yield f"Resonance   {_RESONANCE[shown.resonance].format(rig=rig)}; {told}"
    yield from _cohort_lines(shown.study)


_RESONANCE = {
    "measured": "measured before the first touch",
    "kept": "{rig.nominal_resonance_hz:g} Hz (calibration.json)",
    "missing": "a {rig.dialect} device measures none: write it to calibration.json",
}
_SCORE_WHEN = {
    "agrees": "if the answer agrees with the expectation",
    "noticed": "if the answer says that anything changed",
    "always": "after each answer",
}


def _cohort_lines(study: Study) -> Iterator[str]:
    """Yield the sessions and groups, and when a score is asked for."""
    design = study.design
    if design.sessions > 1:
        apart = hours_in_words(*design.hours_between) if design.hours_between else "any time"
        yield f"Sessions    {design.sessions} of each participant, {apart} between them"
    if study.group:
        sizes = listed(f"{group.name} {group.size}" for group in study.group)
        yield f"Groups      {sizes}; assigned {design.assign_groups}"
    catches = bool(design.catch_trials)
    if study.absolute:
        scale = scale_in_words(study, study.rating)
        when = f"{scale}, at once{', also in catch trials' * catches}"
        yield from wrap(f"Score       {when}", 80, subsequent_indent=" " * 12)
    elif study.condition:
        never = ", never in catch trials" * catches
        yield f"Score       {_SCORE_WHEN[study.rating.score_when]}{never}"


def _recorded_lines(channel: ForceChannel) -> Iterator[str]:
    if channel.rate_hz is None:
        if channel.gauge is not None:
            yield "Recorded    nothing: the gauge needs force_channel.rate_hz"
        return
    measures, share = "board" if channel.gauge is None else "gauge", preview.line_share(channel)
    sent = f"{channel.rate_hz} samples/s by the {measures}: {share:.0%}"
    yield f"Recorded    forces and place in each touch, {sent} of {BAUD:,} baud"
    if share > 1:
        yield "            (more than a serial line carries: connect it by USB or a network)"


def _span(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def _group_lines(study: Study) -> Iterator[str]:
    """Say which answers lead into no group, where one question of the desk decides."""
    rules = [group.when for group in study.group if group.when is not None]
    asked = {question.name: question for question in study.questions("desk")}
    names = {rule.question for rule in rules}
    question = asked.get(min(names)) if len(names) == 1 else None
    if question is None:
        return
    met = {answer for rule in rules for answer in rule.answers}
    left = [value for value in question.values if value not in met] or _gaps(question, rules)
    if left:
        told = listed(left)
        yield f"Groups      no group is for people whose answer to {question.name} is {told}"


def _gaps(question: StudyQuestion, rules: Iterable[AskedIf]) -> list[str]:
    """Return the numbers that answer a question and meet no rule."""
    if not question.is_number:
        return []
    spans = sorted(question.steps_within(rule.at_least, rule.at_most) for rule in rules)
    (at, last), (start, step), gaps = question.steps_within(None, None), question.grid, []
    for low, high in [*spans, (last + 1, last)]:
        if at < low:
            first, end = (f"{start + step * each:.10g}" for each in (at, low - 1))
            several = f"{end} or less" if at == -inf else f"{first} to {end}"
            several = f"{first} or more" if low == inf else several
            gaps.append(first if first == end else several)
        at = max(at, high + 1)
    return gaps


def _carryover_lines(shown: preview.Preview) -> Iterator[str]:
    carryover, names, heading = shown.carryover, shown.study.conditions, "Carry-over"
    file = shown.study.groups
    # In the order of the file; people arrive in another one.
    of = sorted(by_group(shown.plans).items(), key=lambda it: file.index(it[0]) if it[0] else 0)
    for group, plans in of:
        found = carry_over(shown.study, plans)
        many = _many(len(plans), "participant") + (f" of {group}" if group else "")
        if found.balanced:
            yield f"{heading:<11} balanced over {many}"
        else:
            why = f"counts differ by up to {found.imbalance}"
            if not any(map(any, found.counts)):
                why = "no condition directly follows another within a block"
            size, advice = sequences(shown.study), "this design cannot balance it"
            if balance_guaranteed(shown.study, size):
                advice = f"use a multiple of {size} participants"
            yield f"{heading:<11} not balanced over {many} ({why}): {advice}"
        heading = ""
    yield "How often the condition of a column directly follows that of a row:"
    header = ("", *names)
    rows = [
        # The diagonal is empty in most designs: a condition does not follow itself.
        (name, *("" if a == b and not count else str(count) for b, count in enumerate(row)))
        for a, (name, row) in enumerate(zip(names, carryover.counts, strict=True))
    ]
    yield from _table([header, *rows])
