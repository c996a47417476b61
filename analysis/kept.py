"""Results of pure functions, kept under the digest of the function and of its arguments.

What is kept is data: to read it executes nothing, and makes only the records that the function
says it returns. Where it is kept, and for how long, decides the `Shelf` that is handed in.
"""

import json
import typing
import zlib
from base64 import b64decode, b64encode
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, partial
from hashlib import sha256
from types import FunctionType, NoneType, UnionType
from typing import Any, ParamSpec, Protocol, TypeVar, cast, get_args, get_type_hints

import numpy as np

from analysis.workers import done

Given = ParamSpec("Given")
Result = TypeVar("Result")
Records = Mapping[str, type]
"""The classes of the records that a result may contain, by name."""

_IN_MEMORY = 256
_PLAIN = (NoneType, bool, int, float, str)
# Arrays of objects are left out, because only pickle could read them, and it executes what it
# reads.
_NUMBERS = frozenset("biuf")
"""The kinds of array that are kept: truth values and numbers."""
_DAMAGED = (ValueError, LookupError, TypeError, AttributeError, RecursionError, zlib.error)
"""What reading something else than what was kept can raise."""


class NotKept(Exception):
    """A value that is not data, such as a closure: what depends on it is not kept."""


class Shelf(Protocol):
    """Where bytes are kept by name; what it does not have, or no longer, is `None`."""

    def get(self, name: str) -> bytes | None:
        """Return the bytes of that name as they were put."""

    def put(self, name: str, content: bytes) -> None:
        """Keep the bytes under that name, if that is possible."""


class Kept:
    """Calls functions, or takes what the same call returned before: here, or on the `shelf`.

    `version` stands for everything else that results depend on: the code, and its libraries.
    """

    def __init__(self, shelf: Shelf | None = None, version: str = "") -> None:
        self._shelf = shelf
        self._version = version
        self._memory: OrderedDict[str, Any] = OrderedDict()

    def __call__(
        self, function: Callable[Given, Result], *args: Given.args, **named: Given.kwargs
    ) -> Result:
        """Return what the pure `function` returns for these arguments."""
        return self.made(partial(function, *args, **named), function, args, named)

    def made(
        self,
        make: Callable[[], Result],
        returning: Callable[..., Result],
        *of: object,
        worth: Callable[[Result], bool] = lambda _: True,
    ) -> Result:
        """Return what `make` does, which depends on `of` alone and is as `returning` returns it.

        It is kept if it is `worth` that.
        """
        try:
            name = self._name(returning, *of)
        # The result is right all the same; it only cannot be found again.
        except NotKept:
            return make()
        if name not in self._memory:
            # Results travel in a tuple, so that a result of None or 0 is told from none.
            known = self._read(name, returning)
            if known is None:
                value = make()
                if not worth(value):
                    return value
                known = self._written(name, value)
            self._remember(name, known)
        # What was used last is dropped last.
        self._memory.move_to_end(name)
        found: Result = self._memory[name][0]
        return found

    def ahead(self, groups: Iterable[Sequence["partial[Any]"]], processes: int) -> None:
        """Make several calls at a time, for later; not those that are known or cannot be kept.

        Those of a group are made one after the other in the same process.
        """
        work = [partial(_named, wanted) for calls in groups if (wanted := self._unknown(calls))]
        for made in done(work, processes) if work else ():
            for name, value in made.items():
                self._remember(name, self._written(name, value))

    def _unknown(self, calls: Iterable["partial[Any]"]) -> dict[str, "partial[Any]"]:
        """Return those of the calls that are to be made, by name; what is known is remembered."""
        wanted = {}
        for call in calls:
            # The name that `__call__` gives the same call, so that it finds what is made here.
            try:
                name = self._name(call.func, call.args, call.keywords)
            except NotKept:
                continue
            known = self._memory.get(name) or self._read(name, call.func)
            if known is None:
                wanted[name] = call
            else:
                self._remember(name, known)
        return wanted

    def _name(self, function: Callable[..., Any], *of: object) -> str:
        return sha256(_text([self._version, _form(function), _form(of)])).hexdigest()

    def _remember(self, name: str, result: tuple[Any]) -> None:
        self._memory[name] = result
        while len(self._memory) > _IN_MEMORY:
            self._memory.popitem(last=False)

    def _read(self, name: str, function: Callable[..., Any]) -> tuple[Any] | None:
        """Return what the shelf has under that name, in a tuple of its own."""
        content = None if self._shelf is None else self._shelf.get(name)
        if content is None:
            return None
        try:
            found = _value(json.loads(zlib.decompress(content)), _returned(function))
            return (found,) if _fits(found, _hint(function)) else None
        # A file that was cut or changed costs no more than the time to compute it again.
        except _DAMAGED:
            return None

    def _written(self, name: str, value: Result) -> tuple[Result]:
        if self._shelf is not None:
            # The fastest level, because a result that is slow to keep is not worth keeping.
            self._shelf.put(name, zlib.compress(_text(_form(value)), level=1))
        return (value,)


def _named(calls: Mapping[str, Callable[[], Any]]) -> dict[str, Any]:
    return {name: call() for name, call in calls.items()}


def _text(form: object) -> bytes:
    return json.dumps(form, separators=(",", ":")).encode()


def _form(value: Any) -> Any:
    """Return the one JSON form of a value; what JSON lacks has a mapping of its own.

    Raises:
        NotKept: it is, or contains, something else than data.
    """
    kind = type(value)
    if kind in _PLAIN:
        return value
    if isinstance(value, np.generic):
        return _form(value.item())
    if names := _field_names(cast("Hashable", kind)):
        return {_class_name(kind): [_form(getattr(value, name)) for name in names]}
    if kind in {tuple, list}:
        return {kind.__name__: [_form(each) for each in value]}
    if isinstance(value, Mapping):
        return {"mapping": [[_form(key), _form(each)] for key, each in value.items()]}
    return _other_form(value)


def _other_form(value: Any) -> Any:
    if type(value) is np.ndarray and value.dtype.kind in _NUMBERS:
        data = b64encode(np.ascontiguousarray(value).tobytes()).decode()
        return {"array": [value.dtype.str, list(value.shape), data]}
    if type(value) is bytes:
        return {"bytes": b64encode(value).decode()}
    if isinstance(value, partial):
        return {"call": _form((value.func, value.args, value.keywords))}
    if isinstance(value, FunctionType | type) and "<" not in value.__qualname__:  # no closure
        return {"function": _class_name(value)}
    raise NotKept(f"{type(value).__qualname__} is not kept")


def _value(form: Any, records: Records) -> Any:
    """Return the value of a form; only `records` are made, and nothing is called by its name.

    Raises:
        ValueError: no `_form` of such records, or another of `_DAMAGED`.
    """
    if type(form) in _PLAIN:
        return form
    ((kind, given),) = form.items()
    if kind == "array":
        name, shape, data = given
        if np.dtype(name).kind not in _NUMBERS:
            raise ValueError(f"arrays of {name} are not kept")
        # A copy, because an array over a buffer is read-only and a computed one is not.
        return np.frombuffer(b64decode(data, validate=True), name).reshape(shape).copy()
    if kind == "bytes":
        return b64decode(given, validate=True)
    if kind == "mapping":
        return {_value(key, records): _value(each, records) for key, each in given}
    values = [_value(each, records) for each in given]
    if kind in {"tuple", "list"}:
        return tuple(values) if kind == "tuple" else values
    names = _field_names(records[kind])
    return records[kind](**dict(zip(names, values, strict=True)))


@cache
def _field_names(kind: Hashable) -> tuple[str, ...]:
    """Return the names of a record's fields; none of anything else."""
    if is_dataclass(kind):
        # A field that a record computes itself cannot be passed to its constructor.
        return tuple(entry.name for entry in fields(kind) if entry.init)
    return getattr(kind, "_fields", ())


def _class_name(known: Any) -> str:
    return f"{known.__module__}.{known.__qualname__}"


@cache
def _hint(function: Callable[..., Any]) -> Any:
    """Return the type that `function`, or a class, returns."""
    return function if isinstance(function, type) else get_type_hints(function)["return"]


def _fits(value: Any, hint: Any) -> bool:
    """Return whether what was read is of type `hint`, and all that it contains."""
    kind, inner = typing.get_origin(hint) or hint, get_args(hint)
    if kind in {UnionType, typing.Union}:
        return any(_fits(value, each) for each in inner)
    if kind in {Any, typing.Literal} or isinstance(kind, TypeVar):
        return kind is not typing.Literal or value in inner
    # numpy's numbers are kept as Python's, and a whole one may have been given for a float.
    if issubclass(kind, float):
        kind = int | float
    if not isinstance(value, kind):
        return False
    if kind is tuple:
        inner = inner[:1] * len(value) if inner[-1] is Ellipsis else inner
        return len(inner) == len(value) and all(map(_fits, value, inner))
    if isinstance(value, Mapping):
        return all(_fits(each, inner[1]) for each in value.values())
    return all(_fits(getattr(value, name), _hints(kind)[name]) for name in _field_names(kind))


_hints = cache(get_type_hints)


@cache
def _returned(function: Callable[..., Any]) -> Records:
    """Return the records that `function`, or a class, returns, and those that they contain."""
    # The function's own signature says what may be made, so that a file cannot choose.
    records: dict[str, type] = {}
    hints = [_hint(function)]
    while hints:
        hint = hints.pop()
        hints += get_args(hint)
        hint = typing.get_origin(hint) or hint
        if isinstance(hint, type) and _field_names(hint) and _class_name(hint) not in records:
            records[_class_name(hint)] = hint
            hints += get_type_hints(hint).values()
    return records
