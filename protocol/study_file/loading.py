"""From the text of a study file to a checked study, with everything that is wrong at once.

What finds and tells mistakes is loaded when there are any.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from difflib import get_close_matches
from hashlib import sha256
from importlib.resources import files
from types import MappingProxyType
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from protocol.errors import MOST_PROBLEMS, BadInput, Path, Problem, dotted, meant, shown
from protocol.plan.feasibility import design_problems
from protocol.study.fields import LONGEST_NAME, Names, unprintable
from protocol.study.languages import built_in_codes
from protocol.study.study import Study
from protocol.study_file.limits import limit_problems, problems
from protocol.study_file.toml import in_toml, key_lines, line_of, toml_document, unit_hint

# Files beside a study file, languages and pictures: how they go with it, where they are wrong.
#
# The text of a study that has any ends with `[languages]`, which holds each file as one string, and
# with `[pictures]` and `[tables]`, which hold digests. So the text has all that participants read,
# and its own digest tells every change.


def with_languages(text: str, contents: Mapping[str, str]) -> str:
    """Return the text of a study file together with the files of its own languages, by code."""
    return _with_table(text, "languages", contents)


def picture_names(text: str) -> list[str]:
    """Return the names of the pictures on a study's pages and of its surface, if they can be read.

    A surface without a picture says `none`, which names no file.
    """
    document = toml_document(text)
    if isinstance(document, Problem):
        return []
    pages = document.get("page", [])
    tables = [*(pages if isinstance(pages, list) else []), document.get("surface")]
    names = (table.get("picture") for table in tables if isinstance(table, dict))
    return list(dict.fromkeys(name for name in names if isinstance(name, str)))


def pictures_in(text: str) -> dict[str, str]:
    """Return what the text of a study, with its files' digests, knows of each picture."""
    document = toml_document(text) if "[pictures]" in text else {}
    pictures = {} if isinstance(document, Problem) else document.get("pictures")
    # A study file may be anybody's; its own checks say what is wrong with it.
    known = pictures.items() if isinstance(pictures, dict) else ()
    return {name: digest for name, digest in known if isinstance(digest, str)}


def table_name(text: str) -> str | None:
    """Return the name of the file of a surface's friction, if there is one that can be read."""
    document = toml_document(text)
    surface = None if isinstance(document, Problem) else document.get("surface")
    name = surface.get("table") if isinstance(surface, dict) else None
    return name if isinstance(name, str) else None


def with_digests(text: str, table: str, digests: Mapping[str, str]) -> str:
    """Return the text of a study together with digests of files, by name: `pictures`, `tables`."""
    return _with_table(text, table, {in_toml(name): it for name, it in digests.items()})


def without_digests(text: str) -> str:
    r"""Return the text of a study without what `with_digests` adds at its end.

    >>> without_digests(with_digests("a = 1\n", "pictures", {"plate.png": "0f"}))
    'a = 1\n'
    """
    return _DIGESTS.sub("", text)


_DIGESTS = re.compile(r"(\n\[(pictures|tables)\]\n([^\[\n]+ = \"[0-9a-f]+\"\n)+)+\Z")


def _with_table(text: str, name: str, entries: Mapping[str, str]) -> str:
    lines = [f"{key} = {in_toml(value)}" for key, value in entries.items()]
    return "\n".join([text.rstrip("\n"), "", f"[{name}]", *lines, ""]) if entries else text


def whole_document(text: str) -> dict[str, Any] | Problem:
    """Return the values in the text of a study and in its language files, or why there are none."""
    document = toml_document(text)
    if isinstance(document, Problem):
        return document
    for code, content in _files(document).items():
        language = toml_document(content)
        if isinstance(language, Problem):
            return replace(language, file=_name(code))
        document["languages"][code] = language
    return document


def located(text: str, found: list[Problem]) -> list[Problem]:
    """Return the problems with their lines in the study file `text`, in its order.

    What is wrong with a language file gets its line there. Of more than `MOST_PROBLEMS` the first
    ones, and one that says so.
    """
    lines, document = key_lines(text), toml_document(text)
    files = {} if isinstance(document, Problem) else _files(document)
    put = [_located(problem, lines, files) for problem in found]
    put.sort(key=lambda problem: (problem.file, problem.line or 0))
    if len(put) > MOST_PROBLEMS:
        rule = f"at most {MOST_PROBLEMS} problems are listed"
        more = Problem("file", rule, "more", "correct these first")
        return [*put[:MOST_PROBLEMS], more]
    return put


def _located(problem: Problem, lines: Mapping[Path, int], files: Mapping[str, str]) -> Problem:
    code, path = str(problem.path[1]) if len(problem.path) > 1 else "", problem.path[2:]
    if problem.path[:1] != ("languages",) or code not in files:
        return replace(problem, line=line_of(lines, problem.path))
    line = line_of(key_lines(files[code]), path)
    return replace(problem, where=dotted(path), line=line, file=_name(code))


def _files(document: Mapping[str, Any]) -> dict[str, str]:
    languages = document.get("languages")
    if not isinstance(languages, dict):
        return {}
    return {code: content for code, content in languages.items() if isinstance(content, str)}


def _name(code: str) -> str:
    return f"texts/{code}.toml"


# The errors that pydantic finds in a study file, in our words.

_RULES = {
    "less_than_equal": "must be at most {le:.15g}",
    "less_than": "must be below {lt:.15g}",
    "greater_than_equal": "must be at least {ge:.15g}",
    "greater_than": "must be above {gt:.15g}",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be a text",
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "literal_error": "must be one of {expected}",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": "must be a name of letters, digits, . _ and -",
    "too_short": "must have at least {min_length} entries",
    "too_long": "must have at most {max_length} entries",
}
_OUT_OF_RANGE = {"less_than_equal", "greater_than_equal", "float_type"}
_UNKNOWN = "unknown key"
_NEW_LANGUAGE = "touchbeam translate begins the file of another language"
_PEAK = "amplitudes are peak: half of the peak-to-peak value, as a plain number in V"


def schema_problems(document: Mapping[str, Any], error: ValidationError) -> list[Problem]:
    """Return a problem for each error found in `document`, unknown keys before missing ones.

    No more than one above `MOST_PROBLEMS`.
    """
    entries = [entry for entry in error.errors(include_url=False) if not follows(entry)]
    # What is missing is often only misspelt: the unknown key is the one to read first.
    entries.sort(key=lambda entry: entry["type"] == "missing")
    # One more than are listed, so that the list knows that it is cut.
    return [_problem(document, entry) for entry in entries[: MOST_PROBLEMS + 1]]


def follows(entry: Any) -> bool:
    """Return whether a list is called too short only because what it holds is wrong."""
    return bool(entry["type"] == "too_short" and len(entry["input"]) >= entry["ctx"]["min_length"])


def _problem(document: Mapping[str, Any], entry: Any) -> Problem:
    path: Path = tuple(part for part in entry["loc"] if part != "[key]")
    where = place(document, path)
    if entry["type"] == "extra_forbidden":
        return Problem(where, _UNKNOWN, repr(path[-1]), _near_miss(path), path)
    if entry["type"] == "missing" and path and isinstance(path[-1], int):  # one of a pair
        of, value = path[:-1], str(entry["input"])
        return Problem(place(document, of), "must be two numbers, least and most", value, path=of)
    if entry["type"] == "missing":
        return Problem(where, "must be given", "nothing", path=path)
    if entry["type"] == "value_error" and isinstance(entry["input"], Mapping):
        return _disagreement(document, path, entry)
    return Problem(where, _rule(entry), shown(entry["input"]), _hint(document, path, entry), path)


def _hint(document: Mapping[str, Any], path: Path, entry: Any) -> str:
    given, key = entry["input"], str(path[-1])
    if entry["type"] == "string_type" and path[:1] == ("texts",):
        # TOML reads a key with a point in it as a table.
        inner = next(iter(given), None) if isinstance(given, Mapping) else None
        return f'quote the key: "{key}.{inner}" = "..."' if inner else ""
    if key.endswith("_v") or key == "voltages_are":
        return _PEAK
    if entry["type"] in _OUT_OF_RANGE:
        of = path if path[0] != "factor" else (document["factor"][path[1]]["varies"],)
        return unit_hint(of, given, too_large=entry["type"] == "less_than_equal")
    return _meant_choice(entry)


def _disagreement(document: Mapping[str, Any], path: Path, entry: Any) -> Problem:
    """A table whose keys do not fit together: its message says `key rule, got value`."""
    rule, _, value = _rule(entry).partition(", got ")
    key, _, of_key = rule.partition(" ")
    if key in entry["input"]:
        path, rule = (*path, key), of_key
    return Problem(place(document, path), rule, value, path=path)


def _rule(entry: Any) -> str:
    if entry["type"] in _RULES:
        return _RULES[entry["type"]].format(**entry.get("ctx", {}))
    if entry["type"] != "value_error":  # pydantic's own words
        return "cannot be used here"
    rule = str(entry["ctx"]["error"])
    return rule[:1].lower() + rule[1:]


def _meant_choice(entry: Any) -> str:
    """A hint that names the word that was probably meant where only some words will do."""
    if entry["type"] != "literal_error" or not isinstance(entry["input"], str):
        return ""
    words = re.findall(r"'([^']*)'", entry["ctx"]["expected"])
    close = get_close_matches(entry["input"].lower(), words, n=1)
    if close:
        return f"did you mean {close[0]!r}?"
    return "" if {"language", "languages"}.isdisjoint(entry["loc"]) else _NEW_LANGUAGE


def place(document: Mapping[str, Any], path: Path) -> str:
    """Return where `path` leads, in words: `condition voltage, touch 1, ramp_to_v`."""
    if len(path) < 2 or not isinstance(path[1], int):
        return dotted(path)
    words = [f"{path[0]} {_named(document, path[0], path[1])}"]
    for part in path[2:]:
        if isinstance(part, int):
            one = words[-1].removesuffix("s") if words[-1] == "values" else words[-1]
            words[-1] = f"{one.removesuffix('es')} {part + 1}"
        else:
            words.append(part)
    return ", ".join(words)


def _named(document: Mapping[str, Any], kind: str | int, number: int) -> str:
    item = document[str(kind)][number]
    name = item.get("name", item.get("kind")) if isinstance(item, dict) else None
    # A name that could turn the writing of the terminal is not printed, nor one that fills it.
    told = isinstance(name, str) and 0 < len(name) <= LONGEST_NAME and not unprintable(name)
    return str(name) if told else str(number + 1)


def _near_miss(path: Path) -> str:
    """A hint that names the key that was probably meant."""
    key, names = str(path[-1]), _keys_at(path[:-1])
    # Who writes such a key thinks of peak-to-peak: half of the voltage would be meant.
    if any(mark in key.lower() for mark in ("vpp", "peak", "_pp")):
        return f"{_PEAK}; known: {', '.join(names)}"
    close = _meant(path)
    unit = unit_hint((close,)) if close and key.startswith(f"{close}_") else ""
    return f"did you mean {close!r}, {unit}" if unit else meant(key, names)


def _meant(path: Path) -> str | None:
    return next(iter(get_close_matches(str(path[-1]), _keys_at(path[:-1]), n=1)), None)


def unreadable(problem: Problem) -> Path:
    """Return the path of what a problem with the schema hides: of a misspelt key, its right one."""
    if problem.rule != _UNKNOWN:
        return problem.path
    return (*problem.path[:-1], _meant(problem.path) or problem.path[-1])


def _keys_at(path: Path) -> list[str]:
    record: type[BaseModel] = Study
    for part in path:
        fields = {field.alias or name: field for name, field in record.model_fields.items()}
        if part in fields:
            record = _record_in(fields[part].annotation) or record
    return [field.alias or name for name, field in record.model_fields.items()]


def _record_in(annotation: Any) -> type[BaseModel] | None:
    """The record that an annotation such as `tuple[Touch, ...]` contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_record_in, get_args(annotation))), None)


# Problems in the sound part of a study file that breaks the schema.
#
# Without it a misspelt key would hide a 201 V programme until the key is mended.

_TOUCH = {"place": "smooth", "voltage_v": 0}
_ASKED = {"question": "roughness", "expected": "smoother"}
_NAMED = {"beams": (2, 0.0), "texts": (3, "text")}
"""How deep a name stands, and what may stand beside it: a touch that names it still finds it."""
_OF_TABLES = ("opening", "condition", "touches")
"""Lists that keep their length, so that what is found later is still found at its place."""
_OF_THE_DESIGN = frozenset({"touch", "beams", "design", "timing", "opening", "condition", "factor"})
"""What the wishes of a design are counted from."""
_ROUNDS = 8


_OF_THE_SURFACE = frozenset(
    {
        "surface",
        "path_m",
        "paths_m",
        "smooth_place_m",
        "contact_m",
        "friction",
        "levels",
        "standard",
    }
)


def semantic_problems(
    document: dict[str, Any],
    error: ValidationError,
    further: Callable[[Study], Iterable[Problem]],
    known: Mapping[str, Names],
) -> list[Problem]:
    """Return what breaks the schema, and what else is wrong in the rest of the document.

    Problems that only the harmless values in the place of broken ones cause are dropped. `further`
    finds what else is wrong with a study; `known` are the names to choose from, by kind.
    """
    broken = schema_problems(document, error)
    if len(broken) > MOST_PROBLEMS or (study := recovered(document, known)) is None:
        return broken
    unknown = [unreadable(problem) for problem in broken]
    others = [*limit_problems(study), *further(study)]
    if any(path[:1] == ("surface",) for path in unknown):
        # Places and friction are judged by the surface.
        others = [problem for problem in others if not _OF_THE_SURFACE.intersection(problem.path)]
    # A design is counted from these: with one of them replaced, its problems would be made up.
    if not others and _OF_THE_DESIGN.isdisjoint(path[0] for path in unknown if path):
        others = design_problems(study)

    def is_known(path: Path) -> bool:
        """Whether no unknown value lies at `path`, above it or below it."""
        return all(path[: len(other)] != other[: len(path)] for other in unknown)

    return broken + [problem for problem in others if is_known(problem.path)]


def recovered(document: dict[str, Any], known: Mapping[str, Names]) -> Study | None:
    """Return the study that is left when what breaks the schema is replaced by something harmless.

    `None` if nothing can be made of the document. `known` are the names to choose from, by kind.
    """
    sound = deepcopy(document)
    # Taking one wrong part away can uncover another.
    for _ in range(_ROUNDS):
        try:
            return Study.model_validate(sound, context=known)
        except ValidationError as error:
            for entry in error.errors(include_url=False):
                if not follows(entry):
                    _drop(sound, entry["loc"], is_missing=entry["type"] == "missing")
            _fill(sound)
    return None


def _drop(document: dict[str, Any], place: Path, *, is_missing: bool) -> None:
    """Take away the innermost part of the document that is wrong, or lacks what is missing."""
    path = tuple(part for part in place if part != "[key]")
    steps = list(_steps(document, path))
    if len(steps) < len(path) - is_missing:
        return  # what holds it has been taken away
    depth, harmless = _NAMED.get(str(path[0]), (0, None))
    if len(path) == depth and "[key]" not in place:
        steps[-1][0][path[-1]] = harmless
        return
    for length in range(len(steps), 0, -1):
        holder, part = steps[length - 1]
        if isinstance(holder, dict):
            del holder[part]
            return
        if path[length - 2] in _OF_TABLES:
            if not is_missing:
                own = holder[part] if isinstance(holder[part], dict) else {}
                holder[part] = {key: value for key, value in own.items() if key not in _ASKED}
            return


def _steps(document: dict[str, Any], path: Path) -> Iterator[tuple[Any, Any]]:
    """What holds each part of `path`, and the part, as far as the document has it."""
    holder: Any = document
    for part in path:
        try:
            inner = holder[part]
        except (KeyError, IndexError, TypeError):
            return
        yield holder, part
        holder = inner


def _fill(document: dict[str, Any]) -> None:
    """Give what a study, an item and a touch cannot do without."""
    document.setdefault("study", {"name": "unnamed"})
    document.setdefault("condition", [{}])
    for kind in ("opening", "condition"):
        for number, item in enumerate(document.get(kind, ())):
            touches = item.setdefault("touches", [{}])
            for touch in touches:
                touch.update(_TOUCH | touch)
            driven = any(touch["voltage_v"] or touch.get("ramp_to_v") for touch in touches)
            wanted = {"name": f"condition {number + 1}", **_ASKED}
            if kind == "opening":
                wanted = {"kind": "signal" if driven else "baseline"}
            item.update(wanted | item)


TEMPLATES = ("paper", "extended", "threshold", "plate")
GONE = MappingProxyType({"forecast": "touchbeam power says how wide intervals will be"})
"""Tables of older study files that are ignored, and what there is in their place."""
Further = Callable[[Study], Iterable[Problem]]


class StudyError(BadInput):
    """A study file that cannot be used; `problems` lists why, in the order of the file."""

    def __init__(self, source: str, found: list[Problem]) -> None:
        self.source = source
        self.problems = found
        more = f" (and {len(found) - 1} more: touchbeam check)" if len(found) > 1 else ""
        super().__init__(f"{found[0].located(source)}{more}")


def template(name: str) -> str:
    """Return the text of the built-in study `name`, one of `TEMPLATES`."""
    if name not in TEMPLATES:
        raise ValueError(f"the template must be one of {', '.join(TEMPLATES)}, got {name!r}")
    return (files("protocol") / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def template_pictures(name: str) -> dict[str, bytes]:
    """Return the pictures that the built-in study `name` has beside it, by file name."""
    folder = files("protocol") / "templates"
    return {it: (folder / it).read_bytes() for it in picture_names(template(name))}


def template_tests() -> str:
    """Return the text of the test file that every new study gets."""
    return (files("protocol") / "templates" / "test_study.py.txt").read_text(encoding="utf-8")


def parsed_study(
    text: str,
    source: str = "study.toml",
    further: Further = lambda _: (),
    dialects: Mapping[str, Names] = MappingProxyType({}),
) -> Study:
    """Return the study that `text` describes.

    Args:
        text: a study file in TOML.
        source: what to call it in messages.
        further: finds what else is wrong with the study, where more is known than its file says.
        dialects: what devices and gauges there are speak, by kind; without a kind any name will do.

    Raises:
        StudyError: the text is no TOML, breaks the schema, asks for more than the rig allows or
            for what cannot be met.
    """
    document = whole_document(text)
    if isinstance(document, Problem):
        raise StudyError(source, [document])
    for name in GONE:
        document.pop(name, None)
    own = document.get("languages")
    codes = own if isinstance(own, dict) else {}
    known: dict[str, Names] = {
        "languages": lambda: dict.fromkeys([*built_in_codes(), *codes]),
        **dialects,
    }
    try:
        study = Study.model_validate(document, context=known)
    except ValidationError as error:
        wrong = semantic_problems(document, error, further, known)
        raise StudyError(source, located(text, wrong)) from error
    if wrong := problems(study, further(study)):
        raise StudyError(source, located(text, wrong))
    return study


def scale_ends(study_text: str) -> tuple[int, int] | None:
    """Return the ends of a study's scale; None of a file that this version cannot read."""
    try:
        rating = parsed_study(study_text).rating
    except StudyError:
        return None
    return rating.minimum, rating.maximum


def ignored_tables(text: str) -> str:
    """Return the tables in the text of a study that are ignored, in words; '' if none is."""
    if not any(name in text for name in GONE):  # then it need not be read
        return ""
    document = toml_document(text)
    named = {} if isinstance(document, Problem) else document
    return "; ".join(f"[{name}] ({instead})" for name, instead in GONE.items() if name in named)


def text_digest(text: str) -> str:
    """Return the digest that identifies a study file."""
    return sha256(text.encode()).hexdigest()
