"""The table that `make bench` writes."""

import doctest
from types import SimpleNamespace

import pytest

import benchmarks.compared
from benchmarks.compared import compare, page, tell


def bench(name: str) -> SimpleNamespace:
    return SimpleNamespace(name=name, extra_info={}, stats=SimpleNamespace(median=0.25))


def test_a_comparison_has_medians_ratio_and_the_middle_half_of_the_ratios() -> None:
    done = bench("test_a")
    ratio = compare(done, "work", "peer", [2e-3, 4e-3, 6e-3, 8e-3], [1e-3] * 4, "exact")
    assert ratio == pytest.approx(5)
    assert "| work | 5.00 ms | peer | 1.00 ms | 5.00 | 2.50 to 7.50 | exact |\n" in page(
        [done], "m"
    )


def test_what_was_compared_with_nothing_has_a_table_of_its_own() -> None:
    done = bench("test_the_demo_takes_a_minute")
    tell(done, "the demo", most_memory="300 MB")
    text = page([done], "a machine")
    assert "Measured on: a machine." in text
    assert "| the demo | 250 ms | most memory 300 MB |\n" in text


def test_the_examples_of_the_module_are_right() -> None:
    assert doctest.testmod(benchmarks.compared).failed == 0
