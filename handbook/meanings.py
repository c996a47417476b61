"""What the fields of a record mean, where that stands below each of them."""

import ast
from inspect import getsource
from itertools import pairwise


def meanings(kind: type) -> dict[str, str]:
    """Return what stands below the fields of a record, and of those that it is made of."""
    found: dict[str, str] = {}
    for record in kind.__mro__:
        if not record.__module__.startswith(("protocol.", "device.")):
            continue
        (written,) = ast.parse(getsource(record)).body
        assert isinstance(written, ast.ClassDef)
        for field, said in pairwise(written.body):
            match field, said:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(ast.Constant(str(text))):
                    found.setdefault(name, " ".join(text.split()))
    return found
