"""The page on study files, written from their schema: `python -m handbook.study_file`."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from handbook.meanings import meanings
from protocol.study.fields import Record
from protocol.study.study import Study

_Schema = Mapping[str, Any]

_INTRODUCTION = """\
# The study file

`study.toml` says everything that is decided before the sessions. `touchbeam new` writes a first one
to edit; `touchbeam check` shows the plan that follows from it, and lists all errors by line.
`python -m handbook.study_file` writes this page. [The glossary](glossary.md) explains the words.

Lengths are in m, forces in N, times in s. **A voltage is an amplitude (peak), half of what a
generator shows as peak-to-peak.** The frequency of a touch is relative to the resonance that each
session measures: 1.0 drives the beam at its resonance.

Below, `key!` must be given and `key = value` shows the default; other keys have none. What has no
type is a number. An unknown key is an error, and so is a number written as a text. A table of an
older file that nothing obeys any more is ignored, with a line that names it.
"""

_DESIGN = """\
### What the design promises

- `williams` balances carry-over exactly if the cohort is a multiple of n (n even) or 2 n (n odd)
  for n conditions, and trials are not grouped by beam. `touchbeam check` reports the imbalance of
  any other cohort. Carry-over is counted within blocks, which hold every condition once; pairs
  across the end of a block are counted apart.
- If requirements conflict, limits come first, then beam swaps, then carry-over.
- Order, levels, opposite, catch and practice trials, and groups each draw from a random stream of
  their own ([how](mathematics/orders.md)), so a change of one does not change the others. The same
  file gives the same plan on every platform.
- A catch trial is a condition at 0 V. It follows a trial on a single beam, has a condition on the
  same beam, and never opens a block.
- A trial in the opposite order runs touches, ramps and sweeps backwards, and expects the opposite
  answer. A condition that asks whether places swapped has no opposite.
"""


_AS_INSTRUCTED = """\
### A trial that comes again

A touch is judged at its end, before the question. If it was not as instructed, and `retries` are
left, the trial ends there, and the participant reads why. It comes again with all its touches, at
the same level.

- It comes later in its block, at a place drawn evenly from those that need no further beam swap and
  break no rule on runs and catch trials. If there is none, and before the first block, it comes at
  once. Carry-over is then no longer balanced exactly, and the report counts it as run.
- A touch without measured contact is not judged. In exported data its `force_n` is missing.
- Attempts that did not count are in the journal and in the exported table of touches.
"""


_LANGUAGES = """\
A code is one of BCP 47, such as `fr` or `pt-BR`. Every text must be there, with the fields in
braces of the built-in one. A touch may name further keys as its `instruction`. [How to add a
language](how-to/language.md) shows the steps. The journal keeps the file with the study file, and
`touchbeam amend` accepts a change.
"""


_QUESTIONS = """\
| kind | needs | may have |
|---|---|---|
| `choice`, `several` | `labels` with a `value` each, 2 to 9 | |
| `scale` | `minimum`, `maximum` | `step`, `ticks`, `labels` with `at` |
| `analogue` | `labels` with `at = 0` and `at = 100` | |
| `number` | | `minimum`, `maximum`, `decimals`, `unit` |
| `text` | | `max_length` |

[An example](how-to/question.md) asks two questions. With
`asked_if = { question = "noticed", is = ["yes"] }` one is asked only where a change was noticed,
with `{ question = "score", at_least = 5 }` after high scores. What could never be asked is refused.
A question after a trial or a block depends on the answer after that same trial or block, if the
other question is asked there, too; else on the answer that was given once in this session, or in
the first one where `sessions = "first"`. Nothing is asked about a block once the next one has
begun. Lengths count every question. In exported data a question that was not asked has no reaction
time; one that was skipped has.

A question needs a text in every one of `session.languages`. A resumed session does not repeat
answered questions `before`, `after` or after a `block`. Answers about a trial are journalled
together after the last of them; if the trial is interrupted before that, it comes again, with its
questions. Each question has a table in the report, and a column of the [exported
trials](data.md#rows-and-columns).
"""


_SURFACE = """\
Any key of a beam's geometry makes all of them necessary, with patches, `touch.path_m` and
`touch.smooth_place_m`: a half-described beam would silently keep the paper's brass.

```toml
[surface]
length_m = 0.12
thickness_m = 0.003
width_m = 0.01
youngs_modulus_pa = 70e9         # aluminium
density_kg_m3 = 2700
poisson_ratio = 0.33
damping_ratio = 0.005
supports = ["clamped", "clamped"]
mode = 6
bodies = { height_m = 0 }        # a smooth beam

[[surface.patch]]
centre_m = 0.072
length_m = 0.010
width_m = 0.005
thickness_m = 0.0003
youngs_modulus_pa = 76.5e9       # PZT
density_kg_m3 = 7500
poisson_ratio = 0.31
stress_constant_c_m2 = 2.0
```

The table of a `measured` surface has commas, a header, and a row for each combination of values. It
has a column `friction`, and any of `voltage_v`, `frequency` (relative to the resonance), `place_m`
(right edge of the finger), `direction` (`right`, `left`), `force_n`, `speed_m_s` and `beam`;
friction does not depend on a column that is not there. `resonance_hz`, one value, names the
resonance of the measurement. Between the values the logarithm of friction is interpolated; beyond
them nothing is predicted, and `touchbeam check` refuses a touch. It has at most a million rows.

[My surface](how-to/surface.md) says which kind to take.
"""


_PARTS = {
    "surface": [
        ("A piezoelectric patch, in `[[surface.patch]]`", "SurfacePatch"),
        ("Ciliary bodies: `bodies`", "Bodies"),
    ],
    "rating": [("A band, in `bands`", "Band")],
    "question": [("A label, in `labels`", "Label"), ("When it is asked: `asked_if`", "AskedIf")],
    "track": [("The levels, in `levels`", "Levels"), ("When it ends sooner: `stop`", "Stop")],
}
"""The records within a section, each with its heading."""
_PAGES = """\
```toml
[[page]]
picture = "pictures/hand.png"
text = { en = "Lay your hand on the rest, like this.", zh = "请像图中这样把手放在托架上。" }

[[page]]
before = "block"
block = 2
text = { en = "Half of it is done.", zh = "已完成一半。" }
```

A picture has at most 4 MB and 4096 pixels in width and height, and is not a link. `touchbeam check`
says if a text does not fit the smallest screen beside its picture. Pages before the session follow
the welcome. A resumed session shows them again, and those before the block in which it continues.
"""
_GROUPS = """\
A participant has one group in all sessions, which the journal keeps. Orders are drawn for each
group on its own, so that each is balanced:

```toml
[[group]]
name = "young"
size = 20

[[group]]
name = "old"
size = 20
```

With `assign_groups = "by an answer"` the operator is asked before the session is opened:
`when = { question = "age", at_least = 60 }` in a group, and a `[[question]]` called `age` with
`when = "desk"`. An answer that leads into two groups is refused.

With `assign_groups = "at random"` the seed decides which group comes next. Somebody who is
excluded leaves the place to the next participant.
"""
_FACTORS = """\
Each value of a factor meets each value of every other one, in every `[[condition]]`, the last
factor varying fastest. This makes twelve conditions, from `50 V, 23 kHz` to `200 V, 25 kHz`:

```toml
[[factor]]
name = "voltage"
varies = "ramp_to_v"
values = [50, 100, 150, 200]

[[factor]]
name = "frequency"
varies = "frequency_hz"
values = [23000, 24000, 25000]

[[condition]]
name = "ramp"
question = "roughness"
expected = "smoother"
touches = [{ place = "path", voltage_v = 0 }]
```

Where the file has several conditions, each name begins with theirs, and `condition` is a factor,
too. There are at most 30 conditions in all.
"""
_TRACKS = """\
`standard` and `comparison` are touches as below, which hold one drive relative to the resonance;
`voltage_v` is 0 there unless it is given. They have one more key:

- `place_m` (0 to 1): on the axis `place`, where the beam is touched, instead of
  `touch.smooth_place_m`

On the axis `contrast` the voltage of each level is found from the predicted friction.
Steps in dB are whole steps of the levels, else the nearest range of levels is named. Every level is
checked against the limits of the rig, so that no method can ask for one beyond them. In yes or no,
`correct` counts yes. A study with tracks needs no `[[condition]]`. [Measure a
threshold](how-to/threshold.md) shows what each choice gives.
"""
_TEXTS = """\
The keys are those of `[texts]` in `protocol/languages/en.toml`, which has the built-in texts;
`touchbeam translate STUDY CODE` copies them into a file of the study.
"""
_REMARKS = {
    "surface": _SURFACE,
    "texts": _TEXTS,
    "factor": _FACTORS,
    "group": _GROUPS,
    "page": _PAGES,
    "design": _DESIGN,
    "as_instructed": _AS_INSTRUCTED,
    "question": _QUESTIONS,
    "languages": _LANGUAGES,
    "track": _TRACKS,
}


def study_file_page() -> str:
    """Return the page as Markdown."""
    return "\n".join([_INTRODUCTION, *_sections(described_schema())])


def described_schema() -> dict[str, Any]:
    """Return the schema of study files, in which each key has its meaning."""
    schema = Study.model_json_schema()
    kinds = {kind.__name__: kind for kind in _records(Record)}
    for name, record in {Study.__name__: schema, **schema["$defs"]}.items():
        kind, entries = kinds[name], record["properties"]
        for key, meaning in meanings(kind).items():
            entries[kind.model_fields[key].alias or key].setdefault("description", meaning)
    return schema


def _records(kind: type[Record]) -> Iterator[type[Record]]:
    for own in kind.__subclasses__():
        yield own
        yield from _records(own)


def _sections(schema: _Schema) -> Iterator[str]:
    records = schema["$defs"]
    for name, entry in schema["properties"].items():
        record = _record(entry, records)
        description = entry.get("description") or (record or {})["description"]
        yield f"## `{_header(name, entry)}`\n\n{description}\n"
        if record:
            yield _keys(record)
        for part, kind in _PARTS.get(name, ()):
            yield f"### {part}\n\n{_keys(records[kind])}"
        if name in _REMARKS:
            yield _REMARKS[name]
    touch = records["Touch"]
    yield f"## A touch, in `touches`\n\n{touch['description']}\n\n{_keys(touch).rstrip()}\n"


def _header(name: str, entry: _Schema) -> str:
    if entry.get("type") == "array":
        return f"[[{name}]]"
    if name == "languages":
        return "texts/CODE.toml"
    return f"[{name}.en]` and `[{name}.zh]" if name == "texts" else f"[{name}]"


def _record(entry: _Schema, records: _Schema) -> _Schema | None:
    several = (entry.get("items", {}), *entry.get("patternProperties", {}).values())
    reference = entry.get("$ref") or next(
        (each["$ref"] for each in several if "$ref" in each), None
    )
    return records[reference.rpartition("/")[2]] if reference else None


def _keys(record: _Schema) -> str:
    required = record.get("required", [])
    rows = [
        f"- `{_with_default(key, entry, key in required)}` ({_kind(entry)}): {_meaning(entry)}"
        for key, entry in record["properties"].items()
    ]
    if isinstance(other := record.get("additionalProperties"), dict):
        rest = "; else the language's own" if record["title"] == "Band" else "; must be given"
        rows.append(f"- a language's code ({_kind(other)}): {_meaning(other)}{rest}")
    return "\n".join([*rows, ""])


def _meaning(entry: _Schema) -> str:
    return str(entry.get("description", ""))


def _with_default(key: str, entry: _Schema, required: bool) -> str:
    """Return the key as the file would set it to its default: `key!` must be given."""
    if required:
        return f"{key}!"
    value = entry.get("default")
    return key if value is None else f"{key} = {_toml(value)}"


def _toml(value: Any) -> str:
    if isinstance(value, str | bool):
        return json.dumps(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items()) + " }"
    return f"{value:g}"


def _kind(entry: _Schema) -> str:
    """Type, choices and range in words; only what is not a number is named."""
    if options := entry.get("anyOf"):
        kinds = [option for option in options if option.get("type") != "null"]
        merged = {key: value for key, value in {**entry, **kinds[0]}.items() if key != "anyOf"}
        return _kind(merged) if len(kinds) == 1 else "texts or numbers"
    if "enum" in entry or "const" in entry:
        return ", ".join(f"`{_toml(choice)}`" for choice in entry.get("enum", [entry.get("const")]))
    if entry.get("type") == "array":
        return _list_kind(entry)
    if entry.get("type") == "object":
        return f"table of {_kind(entry['additionalProperties'])}"
    if entry.get("type") in ("number", "integer"):
        return ("whole, " if entry["type"] == "integer" else "") + _range(entry)
    said = {"boolean": "true or false", "string": "text"}
    return said.get(entry.get("type", ""), "table")


def _list_kind(entry: _Schema) -> str:
    if "prefixItems" in entry:
        count, first = len(entry["prefixItems"]), entry["prefixItems"][0]
        numbers = first.get("type") in ("number", "integer")
        return f"{count} numbers, {_range(first)}" if numbers else f"{count} of {_kind(first)}"
    items = entry["items"]
    return f"list of {'tables' if '$ref' in items else _kind(items)}"


def _range(entry: _Schema) -> str:
    """Return `0.1 to 10`, `> 0, to 10`, or `from 1`."""
    least, most = entry.get("minimum"), entry.get("maximum")
    above, below = entry.get("exclusiveMinimum"), entry.get("exclusiveMaximum")
    if None not in (least, most):
        return f"{least:.15g} to {most:.15g}"
    ends = [
        *([] if least is None else [f"from {least:.15g}"]),
        *([] if least is not None or above is None else [f"> {above:.15g}"]),
        *([] if most is None else [f"to {most:.15g}"]),
        *([] if most is not None or below is None else [f"< {below:.15g}"]),
    ]
    return ", ".join(ends) or "number"


if __name__ == "__main__":
    print(study_file_page(), end="")
