"""The validator of RO-Crates, without network.

It reads the meaning of terms from the address in a crate's `@context`; it gets the table that the
package `rocrate` has, in which the terms of version 1.1 mean the same.
"""

import warnings
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import requests
from rocrate_validator import services
from rocrate_validator.models import Severity, ValidationSettings
from rocrate_validator.utils.http import HttpRequester

CONTEXT = "https://w3id.org/ro/crate/1.1/context"
PROFILE = "process-run-crate"


def _served(_: HttpRequester, address: str, **__: Any) -> requests.Response:
    assert address == CONTEXT, f"nothing else is fetched, but {address} was asked for"
    response = requests.Response()
    response.status_code = 200
    response.headers["Content-Type"] = "application/ld+json"
    response._content = files("rocrate").joinpath("data/ro-crate.jsonld").read_bytes()
    return response


def complaints(crate: Path, monkeypatch: pytest.MonkeyPatch, cache: Path) -> dict[str, set[str]]:
    """Return what the validator has to say of a Process Run Crate, by severity.

    That profile contains all of RO-Crate 1.1.
    """
    monkeypatch.setattr(HttpRequester, "get", _served, raising=False)
    settings = ValidationSettings(
        rocrate_uri=str(crate),
        profile_identifier=PROFILE,
        requirement_severity=Severity.RECOMMENDED,
        offline=True,
        cache_path=cache,
    )
    found: dict[str, set[str]] = {"REQUIRED": set(), "RECOMMENDED": set()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # its libraries use their own old parts
        issues = services.validate(settings).get_issues()
    for issue in issues:
        found[issue.severity.name].add(issue.message)
    return found
