"""The collector rests while a short command works, and is back afterwards whatever happened."""

import gc

import pytest

from runner.cli.app import short_lived


def test_the_collector_rests_and_comes_back() -> None:
    with short_lived():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert gc.get_freeze_count() > 0
    gc.unfreeze()


def test_it_comes_back_after_a_failure() -> None:
    with pytest.raises(LookupError, match="the body's own"), short_lived():
        raise LookupError("the body's own")
    assert gc.isenabled()
