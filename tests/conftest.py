"""Long runs: thousands of simulated studies, skipped unless they are asked for."""

import pytest

REASON = "takes minutes; run it with `make soak`"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "soak" in config.getoption("-m"):
        return
    for item in items:
        if item.get_closest_marker("soak"):
            item.add_marker(pytest.mark.skip(reason=REASON))
