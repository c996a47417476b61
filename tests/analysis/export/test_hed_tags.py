"""HED tags of exported events: known to the schema that the data set names."""

import json
import socket

import pytest

from analysis.export.bids import HED_VERSION, bids_export
from tests.analysis.export.hed_validator import complaints
from tests.analysis.export.test_formats import nasty


@pytest.fixture(autouse=True)
def offline(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        pytest.fail("the network was asked")

    monkeypatch.setattr(socket.socket, "connect", refused)


def sidecars() -> list[str]:
    files = bids_export(nasty(rehearsals=True))
    return [text for name, text in files.items() if name.endswith("_events.json")]


def test_the_validator_knows_every_tag() -> None:
    told = sidecars()
    assert told
    assert all(json.loads(text)["trial_type"]["HED"] for text in told)
    assert [issue for text in told for issue in complaints(text, HED_VERSION)] == []


def test_the_validator_would_find_a_wrong_tag() -> None:
    wrong = sidecars()[0].replace("Tactile-presentation", "Tactile-frobs", 1)
    assert any("Tactile-frobs" in issue for issue in complaints(wrong, HED_VERSION))
