"""The validator of HED tags, without network: it has the schemas of all versions.

It imports openpyxl, for workbooks, which our environment leaves out (`exclude-dependencies`) and no
test needs. A module of that name, with the one class that a signature names, stands in while it is
imported.
"""

import io
import json
import sys
from types import ModuleType


def complaints(sidecar: str, version: str) -> list[str]:
    """Return the messages on the tags in the text of a BIDS sidecar."""
    workbook = ModuleType("openpyxl.workbook")
    workbook.__dict__["Workbook"] = object
    stand_in = ModuleType("openpyxl")
    stand_in.__dict__["workbook"] = workbook
    sys.modules["openpyxl"] = stand_in
    try:
        import hed
    finally:
        del sys.modules["openpyxl"]
    schema = hed.load_schema_version(version)
    entries = json.loads(sidecar)
    # It takes every entry for a column, also a task's name.
    columns = {name: entry for name, entry in entries.items() if isinstance(entry, dict)}
    issues = hed.Sidecar(io.StringIO(json.dumps(columns)), name="sidecar").validate(schema)
    return [issue["message"] for issue in issues]
