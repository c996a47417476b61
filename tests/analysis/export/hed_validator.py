"""The validator of HED tags, without network: it has the schemas of all versions."""

import io
import json
from unittest.mock import patch


def complaints(sidecar: str, version: str) -> list[str]:
    """Return the messages on the tags in the text of a BIDS sidecar."""
    with patch("typeguard.typechecked", lambda checked: checked):  # it takes seconds to import
        import hed

    schema = hed.load_schema_version(version)
    entries = json.loads(sidecar)
    # It takes every entry for a column, also a task's name.
    columns = {name: entry for name, entry in entries.items() if isinstance(entry, dict)}
    issues = hed.Sidecar(io.StringIO(json.dumps(columns)), name="sidecar").validate(schema)
    return [issue["message"] for issue in issues]
