"""Small errors that a program can have, made on purpose: one change of its syntax tree at a time.

A message to a person may say anything, so texts are not changed: only those that a driver sends,
and those that a comparison or a table has.
"""

import ast
import copy
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
STATES = frozenset(
    ("new", "idle", "armed", "paused", "trial", "touching", "completed", "excluded", "dropped")
)
_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
_CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """The `place`-th change of a file.

    `where`, `what` and `number` tell it from others even after the file was edited elsewhere: it
    is the `number`-th change of this kind in the function `where`.
    """

    path: str
    place: int
    line: int
    where: str
    what: str
    number: int

    @property
    def name(self) -> str:
        """What `mutated_module` takes."""
        return f"{self.path}:{self.place}"

    @property
    def title(self) -> str:
        """What tells it from the others of its file."""
        return f"{self.where}: {self.what}" + (f" ({self.number})" if self.number > 1 else "")

    def __str__(self) -> str:
        return f"{self.path}:{self.line} {self.what}"


@dataclass(frozen=True, kw_only=True)
class _Change:
    node: ast.AST
    into: ast.AST
    where: str

    def __str__(self) -> str:
        return f"{_shown(self.node)} -> {_shown(self.into)}"


def mutants(path: str) -> list[Mutant]:
    """Return every mutant of a file of the project."""
    found, seen = [], Counter[tuple[str, str]]()
    for place, change in enumerate(_changes(path, _parsed(path))):
        what = str(change)
        seen[change.where, what] += 1
        found.append(
            Mutant(
                path=path,
                place=place,
                line=getattr(change.node, "lineno", 0),
                where=change.where,
                what=what,
                number=seen[change.where, what],
            )
        )
    return found


def mutated_module(name: str) -> ast.Module:
    """Return the module of the mutant `name` with its change made."""
    path, _, place = name.partition(":")
    tree = _parsed(path)
    change = _changes(path, tree)[int(place)]
    _Replacement(change).visit(tree)
    return ast.fix_missing_locations(tree)


def _parsed(path: str) -> ast.Module:
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


class _Replacement(ast.NodeTransformer):
    def __init__(self, change: _Change) -> None:
        self._change = change

    def visit(self, node: ast.AST) -> ast.AST:
        if node is self._change.node:
            return ast.copy_location(self._change.into, node)
        return self.generic_visit(node)


def _changes(path: str, tree: ast.Module) -> list[_Change]:
    texts = path.startswith("device/drivers/") and not path.endswith("limits.py")
    left_out = _left_out(tree, texts=texts)
    words = _words(tree, texts=texts)
    return [
        _Change(node=node, into=into, where=where)
        for where, node in _placed(tree, "")
        if id(node) not in left_out
        for into in _replacements(node, is_word=id(node) in words)
    ]


def _placed(node: ast.AST, where: str) -> Iterator[tuple[str, ast.AST]]:
    """Yield every node below `node` with the name of the function or class that it stands in."""
    for inner in ast.iter_child_nodes(node):
        yield where or "module", inner
        if isinstance(inner, ast.FunctionDef | ast.ClassDef):
            yield from _placed(inner, f"{where}.{inner.name}".lstrip("."))
        else:
            yield from _placed(inner, where)


def _left_out(tree: ast.Module, *, texts: bool) -> set[int]:
    """Return the nodes that no guard depends on: annotations, types, messages, simulation."""
    errors = {
        name.asname or name.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").endswith("errors")
        for name in node.names
    }
    found = _simulated(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise):
            found |= _inside(node) - {id(node)}
        if _is_message(node, errors) or (isinstance(node, ast.JoinedStr) and not texts):
            found |= _inside(node)
        for part in ("annotation", "returns", "decorator_list", "format_spec"):
            beside = getattr(node, part, None)
            for inner in beside if isinstance(beside, list) else [beside]:
                found |= _inside(inner)
        if isinstance(node, ast.Assign) and _is_type(node.value):
            found |= _inside(node.value)
    return found


def _simulated(tree: ast.Module) -> set[int]:
    """Return what a module says below its `DRIVER`: what the simulated device does."""
    found: set[int] = set()
    for place, node in enumerate(tree.body):
        if ast.unparse(node).startswith("DRIVER = "):
            found = found.union(*map(_inside, tree.body[place:]))
    return found


def _is_message(node: ast.AST, errors: set[str]) -> bool:
    """Whether `node` makes an error, or says what must be true."""
    is_error = isinstance(node, ast.Call) and getattr(node.func, "id", "") in errors
    return is_error or isinstance(node, ast.Assert)


def _is_type(node: ast.expr) -> bool:
    """Whether `node` is a type that is given a name: `Violations = Iterator[...]`."""
    variable = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "TypeVar"
    return variable or isinstance(node, ast.Subscript)


def _words(tree: ast.Module, *, texts: bool) -> set[int]:
    """Return the texts that something depends on."""
    found: set[int] = set()
    documented: set[int] = set()
    for node in ast.walk(tree):
        match node:
            case ast.Compare() | ast.Dict() | ast.Set():
                found |= _inside(node)
            case ast.Expr(value=ast.Constant()):
                documented |= _inside(node)
    everything = _inside(tree) if texts else found
    return everything - documented


def _inside(node: ast.AST | None) -> set[int]:
    return set() if node is None else {id(inner) for inner in ast.walk(node)}


def _replacements(node: ast.AST, *, is_word: bool) -> Iterator[ast.AST]:
    if isinstance(node, ast.Constant):
        if (other := _other(node.value, is_word=is_word)) is not None:
            yield ast.Constant(other)
    elif isinstance(node, ast.IfExp):
        yield ast.IfExp(node.test, node.orelse, node.body)
    elif isinstance(node, ast.stmt):
        yield from _other_statements(node)
    else:
        yield from _other_expressions(node)


def _other_expressions(node: ast.AST) -> Iterator[ast.AST]:
    into = copy.deepcopy(node)
    match into:
        case ast.Compare():
            yield from _other_comparisons(into)
        case ast.BinOp() if type(into.op) in _OPERATORS:
            into.op = _OPERATORS[type(into.op)]()
            yield into
        case ast.BoolOp():
            into.op = ast.Or() if isinstance(into.op, ast.And) else ast.And()
            yield into
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield into.operand
        case ast.Call(func=ast.Name(id=name)) if name in _CALLS:
            into.func = ast.Name(_CALLS[name], ast.Load())
            yield into


def _other_comparisons(node: ast.Compare) -> Iterator[ast.AST]:
    for number, operator in enumerate(node.ops):
        if type(operator) in _COMPARISONS:
            into = copy.deepcopy(node)
            into.ops[number] = _COMPARISONS[type(operator)]()
            yield into


def _other_statements(node: ast.stmt) -> Iterator[ast.AST]:
    """Yield what `node` becomes if it does not happen, or happens where it should not."""
    match node:
        case ast.If():
            if not _is_turned_itself(node.test):
                yield ast.If(ast.UnaryOp(ast.Not(), node.test), node.body, node.orelse)
            if not node.orelse:
                yield ast.If(ast.Constant(False), node.body, [])
        case ast.Expr(value=ast.Call() | ast.Yield() | ast.YieldFrom()) | ast.Raise():
            yield ast.Pass()
        case ast.Assign(targets=[ast.Attribute()]) | ast.AugAssign():
            yield ast.Pass()
        case ast.Return(value=ast.expr()) if not isinstance(node.value, ast.Constant):
            yield ast.Return(ast.Constant(None))


def _is_turned_itself(test: ast.expr) -> bool:
    """Whether a change of `test` alone is the same as to turn it round."""
    turned = ast.Eq | ast.NotEq | ast.Is | ast.IsNot | ast.In | ast.NotIn
    if isinstance(test, ast.Compare) and len(test.ops) == 1:
        return isinstance(test.ops[0], turned)
    return isinstance(test, ast.UnaryOp)


def _other(value: object, *, is_word: bool) -> bool | int | float | str | None:
    match value:
        case bool():
            return not value
        case int() | float():
            return value * 2 + 1
        case str() if is_word and value in STATES:
            return "armed" if value == "idle" else "idle"
        case str() if is_word and value:
            return f"{value}X"
    return None


def _shown(node: ast.AST) -> str:
    match node:
        case ast.If():
            text = f"if {ast.unparse(node.test)}"
        case ast.Pass():
            text = "nothing"
        case _:
            text = ast.unparse(node)
    short = " ".join(text.split())
    return short if len(short) <= _LONGEST else f"{short[: _LONGEST - 1]}…"


_LONGEST = 70
