"""What the journal must show at the end of a day, read without the code that wrote it."""

import base64
import hashlib
import json
import re
import sqlite3
import zlib
from collections import Counter, defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from protocol.plan.plan import plan
from protocol.proof.trial_checks import cohort_problems, plan_problems
from runner.journal.names import STUDY_CHAIN
from runner.journal.opening import read_journal
from runner.journal.verification import readable_chains, verdicts
from tests.system.day.invariants import require
from tests.system.day.lab import checked_study

if TYPE_CHECKING:
    from tests.system.day.day import Day

_LETTERS = {
    "session-opened": "O", "session-resumed": "R", "practice-renewed": "P", "device-armed": "A",
    "watchdog-tested": "H",
    "rig-described": "D", "beam-mounted": "B", "resonance-measured": "M", "trial-started": "T",
    "touch-started": "S", "touch-recorded": "N", "touch-ended": "E", "answered": "W",
    "trial-aborted": "X", "trial-deferred": "Y", "trials-not-needed": "K",
    "question-answered": "Q",
    "paused": "U", "unpaused": "V", "device-off": "F", "session-completed": "C",
    "trial-excluded": "x", "trial-included": "i", "session-excluded": "Z",
    "session-included": "z", "withdrawn": "G", "note": "", "window-changed": "",
}  # fmt: skip
_TRIAL = "T(?:(?:B?SN?E)+[WY]|(?:B?SN?E)*B?(?:SN?)?X)"
_RUN = f"AH?D?B?(?:M(?:{_TRIAL}|UV|Q|K)*U?)?F"
_BROKEN_OFF = f"AH?D?B?(?:M(?:{_TRIAL}|UV|Q|K)*(?:U|T(?:B?SN?E)*B?(?:SN?)?)?)?"
_DECIDED = "(?:[xi]|Zz)*"
_SESSION = re.compile(
    f"O(?:{_RUN})?{_DECIDED}(?:RP?(?:{_RUN})?{_DECIDED})*"
    f"(?:(?<=F)C{_DECIDED}|(?<=F[xi])C{_DECIDED})?(?:Z?G?|(?:RP?)?(?:{_BROKEN_OFF})?G)"
)
_ROWS = "SELECT session, tag, payload FROM event ORDER BY rowid"

Rows = dict[str, list[tuple[str, dict[str, Any] | None]]]


def at_the_end(day: "Day") -> None:
    """Require all that must hold of the journal at the end of a day."""
    if not day.lab.folder.journal.exists():
        return
    others = day.lab.folder.journal.stat().st_mode & 0o077
    require(10, not others, f"others can read the journal: {others:o}")
    connection = sqlite3.connect(day.lab.folder.journal)
    rows: Rows = defaultdict(list)
    tested = day.lab.watch.rig.dialect != "board"
    for session, tag, payload in connection.execute(_ROWS):
        tested |= tag == "watchdog-tested"
        require(3, tested or tag != "trial-started", f"{session}: the watchdog was not tested")
        rows[session].append((tag, None if payload is None else json.loads(payload)))
    connection.close()
    with read_journal(day.lab.folder.journal) as journal:
        for verdict in verdicts(journal):
            done = verdict.participant in day.doubtful
            require(6, verdict.ok or done, verdict.line())
        broken: list[str] = []
        if not day.doubtful and (day.excluded_trials or day.gone or day.stream.random() < 0.3):
            chains = list(readable_chains(journal, broken))
            _only_what_may_be_seen(day, chains)
    _salted(day.lab.folder.journal)
    for name, events in rows.items():
        if name != STUDY_CHAIN:
            _along_transitions(name, [tag for tag, _ in events])
            if events[0][1] is not None:
                _as_planned(day, name, [(tag, payload or {}) for tag, payload in events])
                _recorded(day, name, [(tag, payload or {}) for tag, payload in events])
    _slots(day, rows)
    erased(day)


def _salted(journal: Path) -> None:
    """No digest can be guessed."""
    connection = sqlite3.connect(f"{journal.as_uri()}?immutable=1", uri=True)
    for payload, digest in connection.execute("SELECT payload, payload_sha256 FROM event"):
        unsalted = hashlib.sha256((payload or "").encode()).hexdigest()
        require(10, digest != unsalted, "the digest of an event is not salted")
    connection.close()


def erased(day: "Day") -> None:
    """Nothing of the touches of somebody who has withdrawn is left in the journal's files."""
    journal = day.lab.folder.journal
    content = b"".join(path.read_bytes() for path in journal.parent.glob(f"{journal.name}*"))
    gone: set[bytes] = set()
    kept: set[bytes] = set()
    for session, payloads in day.lab.touches.items():
        ends = {payload[-80:].encode() for payload in payloads}  # of the last samples, as a rule
        if session.partition("/")[0] in day.withdrawn:
            gone |= ends
        else:
            kept |= ends
    left = [end for end in gone - kept if end in content]
    require(10, not left, f"touches of {day.withdrawn} are left in the journal: {left}")


def _along_transitions(name: str, tags: list[str]) -> None:
    letters = "".join(_LETTERS[tag] for tag in tags)
    require(8, _SESSION.fullmatch(letters), f"{name}: {letters}")


def _as_planned(  # noqa: C901 - a table
    day: "Day", name: str, events: list[tuple[str, dict[str, Any]]]
) -> None:
    """Each trial once, in the order of the plan, in which only deferred trials move."""
    _asked_when_due(day, name, events)
    opened = events[0][1]
    trials = opened["trials"]
    answered: set[int] = set()
    again_on_resume = day.lab.watch.study.session.practise_again == "on resume"
    kinds = {trial["index"]: trial["kind"] for trial in trials}
    order = list(kinds)
    for tag, payload in events:
        if tag == "session-resumed":
            require(9, payload["trials"] == trials, f"{name} was resumed with another plan")
        elif tag == "practice-renewed":
            again = {index for index in answered if kinds[index] == "practice"}
            require(9, set(payload["indices"]) == again, f"{name}: {payload}")
            answered -= again
        elif tag == "device-armed" and again_on_resume:
            done = {index for index in answered if kinds[index] == "practice"}
            require(9, not done, f"{name}: practice {done} was not renewed")
        elif tag == "trial-started":
            due = next((index for index in order if index not in answered), None)
            require(9, payload["index"] == due, f"{name} runs trial {payload['index']}, not {due}")
        elif tag == "trial-deferred":
            require(
                9, _comes_again(order, opened["trials"], payload, answered), f"{name}: {payload}"
            )
        elif tag == "answered":
            require(2, payload["index"] not in answered, f"{name}: {payload['index']} twice")
            answered.add(payload["index"])
        elif tag == "trials-not-needed":
            rest = {each["index"] for each in trials if each["kind"] == "track"} - answered
            require(9, set(payload["indices"]) == rest, f"{name}: {payload}, left are {rest}")
            answered |= rest
    completed = any(tag == "session-completed" for tag, _ in events)
    left = set(kinds) - answered
    require(9, not (completed and left), f"{name} is complete without {left}")
    require(11, completed == (name in day.completed), f"{name}: completed is {completed}")


def _recorded(day: "Day", name: str, events: list[tuple[str, dict[str, Any]]]) -> None:
    """Each touch that ended has one recording, whole and just before, if the study records."""
    rate_hz = day.lab.watch.study.force_channel.rate_hz
    before: tuple[str, dict[str, Any]] = "", {}
    for tag, payload in events:
        if tag == "touch-recorded":
            require(13, rate_hz is not None, f"{name}: recorded without being asked for")
            counts = zlib.decompress(base64.b64decode(payload["samples"]))
            whole = hashlib.sha256(counts).hexdigest() == payload["sha256"]
            require(13, whole and len(counts) == 6 * payload["count"], f"{name}: half a touch")
            first_s = payload["first_s"] + payload["clock_offset_s"]
            lasts_s = payload["moved_s"][1] - first_s
            short_s = lasts_s - payload["count"] / rate_hz - payload["clock_error_s"]
            require(13, short_s < 0.1, f"{name}: {short_s:.2f} s of a touch are lacking")
        if tag == "touch-ended" and rate_hz is not None:
            mine = before[0] == "touch-recorded" and before[1]["touch"] == payload["touch"]
            require(13, mine, f"{name}: a touch after {before[0]} is not recorded")
        before = tag, payload


def _leads_on(answered: dict[str, Any]) -> bool:
    """Return whether an answer asks for the question after the trial: see `studies.as_rated`."""
    if answered["change"] is None:
        return answered["score"] is not None and int(answered["score"]) >= 1
    return answered["change"] not in {"same", "not swapped"}


def _asked_when_due(day: "Day", name: str, events: list[tuple[str, dict[str, Any]]]) -> None:
    """The study's own questions are asked once, as soon as they are due."""
    if not day.lab.watch.study.question:
        return
    left = Counter(trial["block"] for trial in events[0][1]["trials"])
    blocks = {trial["index"]: trial["block"] for trial in events[0][1]["trials"]}
    asked: list[tuple[str, int | None]] = []
    first = ""
    for tag, payload in events:
        if tag == "answered":
            left[blocks[payload["index"]]] -= 1
            about = payload["condition"] is not None and _leads_on(payload)
            told = len(payload.get("questions", ())) == about
            require(9, told, f"{name}: a question depends on what was answered, {payload}")
        elif tag == "trials-not-needed":
            left.subtract(blocks[index] for index in payload["indices"])
        elif tag == "practice-renewed":
            left.update(blocks[index] for index in payload["indices"])
        elif tag == "question-answered":
            asked.append((payload["when"], payload["block"]))
            first = payload["answer"] if payload["when"] == "before" else first
        elif tag in {"trial-started", "session-completed"}:
            due = {("before", None), *(("block", each) for each in left if each and not left[each])}
            # The last question depends on the answer to the first one.
            last = tag == "session-completed" and first == "good"
            due |= {("after", None)} if last else set()
            require(9, sorted(asked) == sorted(due), f"{name}: asked {asked}, due {due}")


def _comes_again(
    order: list[int], trials: list[dict[str, Any]], payload: dict[str, Any], answered: set[int]
) -> bool:
    """Move a deferred trial in `order`; return whether it may come where the event says."""
    index, after = payload["index"], payload["after"]
    if after != index:
        order.remove(index)
        order.insert(order.index(after) + 1, index)
    in_block = trials[index]["block"] == trials[after]["block"]
    return in_block and trials[index]["kind"] != "practice" and after not in answered


def _slots(day: "Day", rows: Rows) -> None:
    study = checked_study(day.lab.text)
    taken: dict[str, tuple[str | None, int]] = {}
    for name, events in rows.items():
        opened = events[0][1]
        if name == STUDY_CHAIN or opened is None:
            continue
        group = opened.get("group")
        require(7, (group in study.groups) == bool(study.group), f"{name}: group {group}")
        own = study.of_group(group)
        drawn = plan(own, opened["slot"], opened["session"])
        problems = plan_problems(own, drawn)
        require(7, not problems, f"{name}: {problems}")
        recorded = [
            (trial["index"], trial["kind"], trial["condition"]) for trial in opened["trials"]
        ]
        planned = [(trial.index, trial.kind, trial.condition) for trial in drawn.trials]
        require(7, recorded == planned, f"{name}: the plan of slot {opened['slot']} is another")
        if name not in day.gone:
            place = group, opened["slot"]
            same = taken.setdefault(opened["participant"], place) == place
            require(7, same or day.gone or day.returned, f"{name} has slot {opened['slot']}")
    if not (day.gone or day.returned or day.doubtful):
        for group in study.groups or (None,):
            slots = sorted(slot for of, slot in taken.values() if of == group)
            require(7, slots == list(range(len(slots))), f"slots {taken}")
            own = study.of_group(group)
            plans = [plan(own, slot) for slot in slots]
            problems = cohort_problems(own, plans) if plans else []
            require(7, not problems, str(problems))


def _only_what_may_be_seen(day: "Day", chains: list[Any]) -> None:
    """Report and export have what was answered, without what was taken back."""
    from analysis.export.dataset import NothingToExport, dataset
    from analysis.loading.study_data import NothingToReport, load_study_data

    study = checked_study(day.lab.text)
    given = {key: answer for key, answer in day.lab.answers.items() if key[0] not in day.gone}
    try:
        data = load_study_data(chains, rehearsals=False)
    except NothingToReport:
        require(10, not given, "answers were given, but nothing is reported")
    else:
        rows = data.trials.to_dict("records")
        shown = {(f"{row['participant']}/{row['session']}", row["trial_index"]) for row in rows}
        wanted = given.keys() - day.excluded_trials
        require(
            10,
            shown == wanted,
            f"reported, but not to be: {shown - wanted}; lacking: {wanted - shown}",
        )
    try:
        table = dataset(chains, study, "today", rehearsals=False).trials
    except NothingToExport:
        require(10, not given, "answers were given, but nothing is exported")
        return
    for row in table.to_dict("records"):
        name, index = f"{row['participant']}/{row['session']}", row["trial_index"]
        require(10, row["participant"] not in day.withdrawn, f"{name} has withdrawn")
        by_hand = "trial" if (name, index) in day.excluded_trials else "no"
        mark = "session" if name in day.gone else by_hand
        require(10, row["excluded"] == mark, f"{name} {index}: {row['excluded']}, not {mark}")
        shown_answer = _plain(row["change"]), _plain(row["score"])
        same = shown_answer == given.get((name, index), shown_answer)
        require(2, same, f"{name} {index}: exported {shown_answer}")


def _plain(cell: Any) -> Any:
    return None if cell is None or cell != cell else cell  # noqa: PLR0124 - NaN
