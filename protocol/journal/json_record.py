"""Records stored in a journal as JSON: their keys, and how each is read and written."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, dataclass, field, fields
from functools import cache
from itertools import chain, starmap
from types import NoneType, UnionType
from typing import (
    Any,
    ClassVar,
    Final,
    NamedTuple,
    Self,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

_REQUIRED: Final = object()
# No quantity of a study is as large. NaN and infinity fail the comparison, too.
_LARGEST = 1e18
_WHOLE = 2**63
"""What a whole number in a column of a table must be below."""
_Reader = Callable[[Any], Any]


@dataclass(frozen=True)
class Key:
    """The meaning of a payload key, and its value where an earlier build did not write it.

    A key without `missing` is required: every build has written it. A `sparse` one is left out
    where it has the value `missing`. A whole number has 63 bits unless it may be of `any_size`.
    """

    meaning: str
    missing: Any = _REQUIRED
    sparse: bool = False
    any_size: bool = False

    @property
    def required(self) -> bool:
        """Whether every build has written the key."""
        return self.missing is _REQUIRED


def key(meaning: str = "", missing: Any = _REQUIRED, *, any_size: bool = False) -> Any:
    """Return a field that whoever makes the record must give."""
    return field(metadata={"key": Key(meaning, missing, any_size=any_size)})


def absent(value: Any, meaning: str = "") -> Any:
    """Return a field that is `value` by default, and where an earlier build did not write it."""
    return field(default=value, metadata={"key": Key(meaning, missing=value)})


def sparse(meaning: str = "") -> Any:
    """Return a field that is None by default, and is then not written."""
    return field(default=None, metadata={"key": Key(meaning, missing=None, sparse=True)})


class KeyOf(NamedTuple):
    """A key of a record: its name, its type, its meaning and the reader of its value."""

    name: str
    type: Any
    key: Key
    read: _Reader


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key,))
class JsonRecord:
    """The keys of a JSON object: each class of it is a frozen dataclass by itself.

    Every field is `key(...)`, `absent(...)` or `sparse(...)`; a meaning that takes more than its
    line stands below it. Its type determines how the JSON value is read: as another record, a named
    tuple, a tuple of any of these, or a plain value.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)

    def to_json(self) -> dict[str, Any]:
        """Return the record as a JSON object of dicts, lists and plain values."""
        keys = [(key, getattr(self, key.name)) for key in self.json_keys()]
        return {
            key.name: as_json(value)
            for key, value in keys
            # A key that came later is left out where it says nothing, so that studies without it
            # are written as before.
            if not (key.key.sparse and value == key.key.missing)
        }

    @classmethod
    def from_json(cls, payload: Mapping[str, Any]) -> Self:
        """Return the record of a JSON object; unknown keys are ignored.

        A missing key is a KeyError, a value of a wrong shape a TypeError or AttributeError.
        """
        plain, read, missing = cls._reading()
        record = cls.__new__(cls)
        # A frozen dataclass' own __init__ assigns field by field, which takes most of the time.
        fields = vars(record)
        for name in plain:
            fields[name] = payload[name] if name in payload else missing[name]
        for name, reader in read:
            fields[name] = reader(payload[name]) if name in payload else missing[name]
        return record

    @classmethod
    def misfit(cls, payload: Mapping[str, Any]) -> str:
        """Return which key of a JSON object is missing or has no value of its type; else nothing.

        `from_json` takes plain values as they are, because journals are read often and written by
        touchbeam alone. What came from elsewhere is judged here, and what has led to an error.
        """
        for name, hint, key, _ in cls.json_keys():
            if key.any_size and type(payload.get(name)) is int:
                continue
            if name in payload and (wrong := _misfit(payload[name], hint, name)):
                return wrong
            if key.required and name not in payload:
                return f"{name} is missing"
        return ""

    @classmethod
    @cache
    def _reading(cls) -> tuple[tuple[str, ...], tuple[tuple[str, _Reader], ...], dict[str, Any]]:
        """Return the keys with plain values, those with readers, and the values of missing keys."""
        keys = cls.json_keys()
        return (
            tuple(name for name, _, _, read in keys if read is _as_it_is),
            tuple((name, read) for name, _, _, read in keys if read is not _as_it_is),
            {name: key.missing for name, _, key, _ in keys if not key.required},
        )

    @classmethod
    @cache
    def json_keys(cls) -> tuple[KeyOf, ...]:
        """Return the keys of the object in the order in which they are written."""
        kinds = get_type_hints(cls)
        return tuple(
            KeyOf(each.name, kinds[each.name], each.metadata["key"], _reader(kinds[each.name]))
            for each in fields(cls)
        )


def is_optional(hint: Any) -> bool:
    """Return whether `hint` is a type such as `int | None`."""
    return get_origin(hint) is UnionType


def as_json(value: Any) -> Any:
    """Return `value` as JSON: dicts, lists and plain values."""
    if isinstance(value, JsonRecord):
        return value.to_json()
    if isinstance(value, Mapping):
        return {name: as_json(entry) for name, entry in value.items()}
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [as_json(entry) for entry in value]
    return value


def _reader(hint: Any) -> _Reader:
    """Return the function that converts JSON to a value of type `hint`."""
    if is_optional(hint):
        read = _reader(next(part for part in get_args(hint) if part is not NoneType))
        return read if read is _as_it_is else lambda value: None if value is None else read(value)
    if get_origin(hint) is tuple:
        kind = get_args(hint)[0]
        if isinstance(kind, type) and issubclass(kind, tuple):  # the samples of long traces
            return lambda values: tuple(starmap(kind, values))
        each = _reader(kind)
        return tuple if each is _as_it_is else lambda values: tuple(map(each, values))
    if isinstance(hint, type) and issubclass(hint, JsonRecord):
        return hint.from_json
    if isinstance(hint, type) and issubclass(hint, tuple):
        return lambda values: hint(*values)
    return _as_it_is


def _misfit(value: Any, hint: Any, name: str) -> str:
    """Return the first part of the JSON value of a key that is not of type `hint`, or nothing."""
    if is_optional(hint):
        return "" if value is None else _misfit(value, get_args(hint)[0], name)
    if isinstance(hint, type) and issubclass(hint, JsonRecord) and isinstance(value, Mapping):
        wrong = hint.misfit(value)
        return wrong and f"{name}, {wrong}"
    if (parts := _parts(value, hint)) is None:
        return f"{name} has a value that it cannot have"  # not which: a person may have told it
    return next(filter(None, (_misfit(part, of, name) for part, of in parts)), "")


def _parts(value: Any, hint: Any) -> Iterable[tuple[Any, Any]] | None:
    """Return what a JSON value of type `hint` contains, with its types; None if of another type."""
    origin, kinds = get_origin(hint), get_args(hint)
    if origin is tuple:
        if not isinstance(value, list):
            return None
        # A long trace is judged as a whole: number by number would take as long as all the rest.
        return () if _are_samples(value, kinds[0]) else ((each, kinds[0]) for each in value)
    if origin is not None:
        return ((it, kinds[1]) for it in value.values()) if isinstance(value, Mapping) else None
    if hint in {int, float}:
        return () if _is_number(value, hint) else None
    if hint is not Any and issubclass(hint, tuple):
        kinds = tuple(hint.__annotations__.values())
        fits = isinstance(value, list) and len(value) == len(kinds)
        return zip(value, kinds, strict=True) if fits else None
    return () if hint is Any or type(value) is hint else None


def _is_number(value: Any, hint: type) -> bool:
    # `type` and not `isinstance`, because True is an int.
    if hint is int:
        return type(value) is int and -_WHOLE <= value < _WHOLE
    # JSON of other programs may have 7 for 7.0. A quantity must be one that can be, not NaN.
    return type(value) in {int, float} and abs(value) < _LARGEST


def _are_samples(rows: list[Any], hint: Any) -> bool:
    """Return whether the rows are those of a named tuple of numbers, and `hint` is one."""
    if not (isinstance(hint, type) and issubclass(hint, tuple)):
        return False
    kinds = tuple(hint.__annotations__.values())
    if {*kinds} != {float} or {*map(type, rows)} - {list} or {*map(len, rows)} - {len(kinds)}:
        return False
    numbers = [*chain.from_iterable(rows)]
    if {*map(type, numbers)} - {int, float}:
        return False
    return min(numbers, default=0) > -_LARGEST and max(numbers, default=0) < _LARGEST


def _as_it_is(value: Any) -> Any:
    return value
