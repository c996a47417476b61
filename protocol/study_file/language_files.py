"""Files beside a study file, languages and pictures: how they go with it, where they are wrong.

The text of a study that has any ends with `[languages]`, which holds each file as one string, and
`[pictures]`, which holds their digests. So the text has all that participants read, and its own
digest tells every change.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from protocol.errors import MOST_PROBLEMS, Path, Problem
from protocol.study_file.toml import key_lines, line_of, toml_document


def with_languages(text: str, contents: Mapping[str, str]) -> str:
    """Return the text of a study file together with the files of its own languages, by code."""
    if not contents:
        return text
    # A string of JSON is one of TOML, but for one control character.
    lines = [
        f"{code} = {json.dumps(content, ensure_ascii=False)}".replace("\x7f", "\\u007f")
        for code, content in contents.items()
    ]
    return "\n".join([text.rstrip("\n"), "", "[languages]", *lines, ""])


def picture_names(text: str) -> list[str]:
    """Return the names of the pictures on the pages of a study, as far as they can be read."""
    document = toml_document(text)
    pages = [] if isinstance(document, Problem) else document.get("page", [])
    tables = [page for page in pages if isinstance(page, dict)] if isinstance(pages, list) else []
    names = (page.get("picture") for page in tables)
    return list(dict.fromkeys(name for name in names if isinstance(name, str)))


def with_pictures(text: str, digests: Mapping[str, str]) -> str:
    """Return the text of a study together with the digests of its pictures, by name."""
    if not digests:
        return text
    lines = [
        f"{json.dumps(name, ensure_ascii=False)} = {json.dumps(digest)}"
        for name, digest in digests.items()
    ]
    return "\n".join([text.rstrip("\n"), "", "[pictures]", *lines, ""])


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
        more = Problem(where="file", rule=rule, value="more", hint="correct these first")
        return [*put[:MOST_PROBLEMS], more]
    return put


def _located(problem: Problem, lines: Mapping[Path, int], files: Mapping[str, str]) -> Problem:
    code, path = str(problem.path[1]) if len(problem.path) > 1 else "", problem.path[2:]
    if problem.path[:1] != ("languages",) or code not in files:
        return replace(problem, line=line_of(lines, problem.path))
    line = line_of(key_lines(files[code]), path)
    return replace(problem, where=".".join(map(str, path)) or "file", line=line, file=_name(code))


def _files(document: Mapping[str, Any]) -> dict[str, str]:
    languages = document.get("languages")
    if not isinstance(languages, dict):
        return {}
    return {code: content for code, content in languages.items() if isinstance(content, str)}


def _name(code: str) -> str:
    return f"texts/{code}.toml"
