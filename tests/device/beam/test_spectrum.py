"""Natural frequencies and mode shapes against closed forms, published tables and exact waves."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest

from device.arrays import FloatArray
from device.beam.beam import Beam, Patch
from device.beam.spectral import (
    Mesh,
    Spectrum,
    elements,
    natural_frequency_hz,
    solved,
    spectrum,
    spectrum_with_mode,
)
from device.errors import OutOfRangeError
from protocol.study.surface import Support
from tests.device.beam import beam_reference, exact_waves
from tests.device.beam.random_beams import random_beam

PLAIN = Beam(length_m=1.0, patches=())
MODES = range(1, 9)


def _roots(beam: Beam, modes: Spectrum) -> FloatArray:
    """Return kL of Euler and Bernoulli's waves at the natural frequencies but the rigid ones."""
    bare, omega = beam.bare, 2 * math.pi * modes.frequencies_hz[beam.rigid_modes :]
    unit = math.sqrt(bare.mass_kg_per_m / bare.bending_n_m2)
    return np.sqrt(omega * unit) * beam.length_m


def _hyperbolic(sign: int) -> Callable[[mp.mpf], mp.mpf]:
    return lambda b: mp.cos(b) - sign / mp.cosh(b)


CLOSED: dict[tuple[Support, Support], tuple[Callable[[mp.mpf], mp.mpf], float, float]] = {
    ("clamped", "free"): (_hyperbolic(-1), -0.5, 1.8751),
    ("clamped", "clamped"): (_hyperbolic(1), 0.5, 4.7300),
    ("free", "free"): (_hyperbolic(1), 0.5, 4.7300),
    ("pinned", "pinned"): (mp.sin, 0.0, math.pi),
    ("clamped", "pinned"): (lambda b: mp.tan(b) - mp.tanh(b), 0.25, 3.9266),
    ("pinned", "free"): (lambda b: mp.tan(b) - mp.tanh(b), 0.25, 3.9266),
}
"""The frequency equation, its roots over π beyond the mode's number, and the first root."""


@pytest.mark.parametrize("slenderness", [1e-2, 1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("supports", CLOSED)
def test_slender_beams_have_the_textbooks_frequencies(
    supports: tuple[Support, Support], turned: bool, slenderness: float
) -> None:
    equation, beyond, first = CLOSED[supports]
    beam = replace(PLAIN, supports=supports[::-1] if turned else supports, thickness_m=slenderness)
    ours = _roots(beam, spectrum_with_mode(beam, MODES[-1]))
    assert beam.rigid_modes == {"pinned, free": 1, "free, free": 2}.get(", ".join(supports), 0)
    for mode in MODES:
        exact = float(mp.findroot(equation, first if mode == 1 else (mode + beyond) * mp.pi))
        # Shear and rotary inertia take off a part of (kh)².
        assert abs(ours[mode - 1] / exact - 1) < 0.4 * (exact * slenderness) ** 2 + 1e-10
    assert round(float(ours[0]), 4) == round(first, 4) or slenderness > 1e-4


@pytest.mark.parametrize("mode", [1, 2, 6, 20, 40])
def test_without_shear_a_cantilever_is_the_closed_form(mode: int) -> None:
    beam = replace(PLAIN, thickness_m=1e-5)
    modes = spectrum_with_mode(beam, mode, shear=False)
    assert _roots(beam, modes)[mode - 1] == pytest.approx(
        float(beam_reference.root(mode)), rel=1e-11
    )
    x_m = np.linspace(0.0, 1.0, 53)
    exact = np.array([float(beam_reference.shape(mode, mp.mpf(x))) for x in x_m.tolist()])
    shape = modes.elements.deflection_at(modes.shapes[:, mode - 1], x_m)
    np.testing.assert_allclose(2 * shape / shape[-1] * np.sign(exact[-1]), exact, atol=1e-8)


@pytest.mark.parametrize("slenderness", [1e-3, 0.03, 0.1])
def test_a_beam_pinned_twice_has_both_of_timoshenkos_spectra(slenderness: float) -> None:
    """In closed form: two frequencies of each sin(nπx), and one of ψ alone at the cut-off."""
    beam = replace(PLAIN, supports=("pinned", "pinned"), thickness_m=slenderness)
    bare, k2 = beam.bare, (np.arange(1, 61) * math.pi) ** 2
    rotary = bare.rotary_kg_m / bare.mass_kg_per_m
    b = 1 + k2 * (rotary + bare.bending_n_m2 / bare.shear_n)
    c = bare.bending_n_m2 * k2**2 / bare.mass_kg_per_m
    a = bare.rotary_kg_m / bare.shear_n
    root = np.sqrt(b * b - 4 * a * c)
    lower, upper = np.sqrt(2 * c / (b + root)), np.sqrt((b + root) / (2 * a))
    cut_off = 2 * math.pi * bare.cut_off_hz
    exact = np.sort([*lower, cut_off, *upper])[:60] / (2 * math.pi)
    if slenderness == 0.1:
        assert (exact > bare.cut_off_hz * 1.0001).sum() > 40
    modes = spectrum(beam, float(exact[-1]))
    np.testing.assert_allclose(modes.frequencies_hz[:60], exact, rtol=2e-10)


@pytest.mark.parametrize(
    ("slenderness", "published"),
    [
        (0.002, 4.72998),
        (0.005, 4.72963),
        (0.01, 4.72840),
        (0.02, 4.72350),
        (0.05, 4.68991),
        (0.1, 4.57955),
        (0.2, 4.24201),
    ],
)
def test_a_beam_clamped_twice_has_the_published_frequency(
    slenderness: float, published: float
) -> None:
    """J. Lee and W. W. Schultz, Journal of Sound and Vibration 269 (2004) 609-621: ν .3, κ 5/6.

    Cowper's κG/E = 5/(12 + 11ν) is their 1/3.12 at ν = 3.6/11.
    """
    ends: tuple[Support, Support] = ("clamped", "clamped")
    beam = replace(PLAIN, supports=ends, thickness_m=slenderness, poisson_ratio=3.6 / 11)
    modes = spectrum_with_mode(beam, 1)
    assert round(float(_roots(beam, modes)[0]), 5) == published
    own_hz = float(modes.frequencies_hz[0])
    assert own_hz == pytest.approx(float(exact_waves.natural_frequency(beam, own_hz)), rel=1e-11)


@pytest.mark.parametrize("mode", [1, 6, 25])
@pytest.mark.parametrize(("patched", "shear"), [(True, False), (False, True), (True, True)])
def test_the_papers_beam_has_the_frequencies_of_exact_waves(
    patched: bool, shear: bool, mode: int
) -> None:
    ours = natural_frequency_hz(Beam(), mode, patched=patched, shear=shear)
    exact = exact_waves.natural_frequency(Beam(), ours, patched=patched, shear=shear)
    assert ours == pytest.approx(float(exact), rel=1e-12)


def test_published_resonances_of_the_papers_beam() -> None:
    kinds = ((False, False), (True, False), (False, True), (True, True))
    assert [
        round(natural_frequency_hz(Beam(), 6, patched=patched, shear=shear), 1)
        for patched, shear in kinds
    ] == [24105.1, 24513.1, 21320.2, 21624.8]


@pytest.mark.parametrize("seed", range(12))
def test_random_beams_have_the_frequencies_of_exact_waves(seed: int) -> None:
    draw = np.random.default_rng(seed)
    beam = random_beam(draw)
    modes = spectrum(beam, beam.bare.frequency_hz(9 * math.pi / beam.length_m))
    reached = modes.frequencies_hz[modes.frequencies_hz <= modes.highest_hz]
    for own_hz in reached[beam.rigid_modes :][::4].tolist():
        exact = exact_waves.natural_frequency(replace(beam, frequency_scale=1.0), own_hz)
        assert own_hz == pytest.approx(float(exact), rel=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_no_mode_is_missed(seed: int) -> None:
    """The determinant of exact waves changes its sign between every two neighbours."""
    beam = replace(random_beam(np.random.default_rng(100 + seed)), frequency_scale=1.0)
    modes = spectrum(beam, beam.bare.frequency_hz(6 * math.pi / beam.length_m))
    own_hz = modes.frequencies_hz[modes.frequencies_hz < modes.highest_hz][beam.rigid_modes :]
    between = np.concatenate([[own_hz[0] / 2], np.sqrt(own_hz[1:] * own_hz[:-1])])
    signs = [mp.sign(mp.re(exact_waves.Waves(beam, hz).determinant)) for hz in between.tolist()]
    assert all(one == -other for one, other in pairwise(signs))


def test_modes_that_lie_close_together_are_all_there() -> None:
    """Above its cut-off a thick beam has two kinds of modes, side by side."""
    beam = replace(PLAIN, supports=("pinned", "pinned"), thickness_m=0.1)
    near = spectrum(beam, 3 * beam.cut_off_hz).frequencies_hz
    near = near[near < 3 * beam.cut_off_hz]
    assert np.diff(near).min() / near[-1] < 3e-3
    assert (np.diff(near) > 0).all()


def test_modes_of_a_slender_beam_do_not_cancel() -> None:
    """With W and ψ as the unknowns frequencies would be off by 3e-4."""
    beam = replace(PLAIN, thickness_m=1e-5)
    with_shear = _roots(beam, spectrum_with_mode(beam, 12))[:12]
    exact = [float(beam_reference.root(mode)) for mode in range(1, 13)]
    correction = 0.4 * (np.array(exact) * 1e-5) ** 2
    assert (np.abs(with_shear / exact - 1) < correction + 1e-10).all()


def test_modes_of_which_the_value_is_rounding_are_left_out() -> None:
    beam = replace(PLAIN, thickness_m=1e-5)
    parts = elements(beam, natural_frequency_hz(beam, 40), Mesh(), patched=True, shear=True)
    modes = solved(beam, 1.0, parts)
    assert modes.values.min() > 1e-12 * modes.values.max()
    assert modes.values.size < parts.size - 2
    assert np.isfinite(modes.shapes).all()


def test_rigid_motions_are_known_and_moved_by_no_patch() -> None:
    beam = replace(Beam(), supports=("free", "free"))
    modes = spectrum_with_mode(beam, 3)
    assert (modes.frequencies_hz[:2] == 0).all()
    assert (modes.forces[:2] == 0).all()
    assert modes.frequencies_hz[2] > 100
    assert replace(beam, supports=("pinned", "free")).rigid_modes == 1


def test_a_beam_turned_round_has_the_same_frequencies() -> None:
    patch = replace(Patch(), centre_m=0.02, faces="upper")
    beam = Beam(supports=("clamped", "pinned"), patches=(patch,))
    turned = replace(beam, supports=("pinned", "clamped"), patches=(replace(patch, centre_m=0.08),))
    ours, other = (spectrum_with_mode(one, 10).frequencies_hz[:10] for one in (beam, turned))
    np.testing.assert_allclose(ours, other, rtol=1e-12)


def test_modes_come_with_more_digits_from_finer_elements() -> None:
    exact = spectrum_with_mode(Beam(), 8, Mesh(16, 3.0)).frequencies_hz[:8]
    for mesh, error in ((Mesh(8, 3.5), 1e-8), (Mesh(12, 4.0), 1e-12)):
        ours = spectrum_with_mode(Beam(), 8, mesh).frequencies_hz[:8]
        np.testing.assert_allclose(ours, exact, rtol=error)


@pytest.mark.parametrize(
    ("beam", "mode", "message"),
    [
        (Beam(), 0, "mode must be a whole number of at least 1, got 0"),
        (Beam(), 2.5, "mode must be a whole number of at least 1, got 2.5"),
        (replace(PLAIN, thickness_m=1e-4), 41, "mode must be at most 40, got 41"),
        (Beam(), 40, "mode must lie below the beam's cut-off at 218 kHz (27 modes), got 40"),
        (
            replace(PLAIN, thickness_m=0.2, frequency_scale=2.0),
            9,
            "mode must lie below the beam's cut-off at 11 kHz",
        ),
    ],
)
def test_a_mode_that_the_beam_does_not_have_is_refused(beam: Beam, mode: int, message: str) -> None:
    with pytest.raises(OutOfRangeError, match=re.escape(message)):
        natural_frequency_hz(beam, mode)
