"""What touchbeam needs may be used in a program of GPL-3.0-or-later."""

import doctest

import handbook.licences
from handbook.licences import is_compatible, licence, needed


def test_every_package_that_touchbeam_needs_has_a_compatible_licence() -> None:
    found = {package.metadata["Name"]: licence(package) for package in needed()}
    assert {"psychopy", "numpy", "pyglet"} <= set(found)
    assert {name: text for name, text in found.items() if not is_compatible(text)} == {}


def test_the_examples_of_the_module_are_right() -> None:
    assert doctest.testmod(handbook.licences).failed == 0
