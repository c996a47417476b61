"""Driven motion and its pattern against exact waves, and what went wrong with other ways."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from device.arrays import FloatArray
from device.beam.beam import Beam, Patch
from device.beam.driven import FINENESS, Fineness
from device.beam.fields import Field, driven_fields
from device.beam.spectral import Mesh, fine_to_hz, natural_frequency_hz
from device.errors import OutOfRangeError
from protocol.study.surface import Support
from tests.device.beam import exact_waves
from tests.device.beam.exact_waves import Waves
from tests.device.beam.random_beams import (
    compared,
    random_beam,
    random_drive_hz,
)

HELD: tuple[Support, ...] = ("clamped", "pinned")


def _field(beam: Beam, frequency_hz: float, fineness: Fineness = FINENESS) -> Field:
    """Return the field per volt of one drive."""
    drive = np.array([frequency_hz]), np.array([beam.damping_ratio])
    ((_, field),) = driven_fields(beam, *drive, fineness)
    return field


def _right_and_mean(
    beam: Beam, frequency_hz: float, x_m: FloatArray, contact_m: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    window = _field(beam, frequency_hz).pattern.window(x_m, contact_m)
    return window.right, window.mean


@pytest.mark.parametrize("seed", range(14))
def test_friction_on_random_beams_is_that_of_exact_waves(seed: int) -> None:
    errors = compared(seed)
    assert errors["rms"] < 1e-9
    assert errors["consistent"] < 1e-6
    assert errors["coulomb"] < 1e-6


@pytest.mark.soak
def test_friction_on_300_random_beams_is_that_of_exact_waves() -> None:
    """Prints largest and median errors in μ', of which the drive off is .4."""
    errors = [compared(1000 + seed) for seed in range(300)]
    for kind in errors[0]:
        values = np.array([one[kind] for one in errors])
        print(f"{kind}: largest {values.max():.1e}, median {np.median(values):.1e}")
    assert max(one["consistent"] for one in errors) < 1e-6
    assert max(one["coulomb"] for one in errors) < 1e-6


def test_a_narrow_window_over_the_least_motion_has_its_magnitude() -> None:
    """Quadrature in zones alone took .004456 for it."""
    beam, frequency_hz = Beam(damping_ratio=2.3e-8), 14996.078576003623
    x_m, contact_m = np.array([0.04934935]), 7.5e-5
    _, mean = _right_and_mean(beam, frequency_hz, x_m, contact_m)
    waves = Waves(beam, frequency_hz, beam.damping_ratio).solve()
    _, area = waves.under(x_m, np.array([contact_m]))
    exact = area[0] / contact_m / waves.rms()[0]
    assert exact == pytest.approx(0.005185, abs=5e-7)
    assert mean[0] == pytest.approx(float(exact), abs=2e-8)


def _turned(beam: Beam) -> Beam:
    """Return the beam seen from the other side."""
    patches = [replace(p, centre_m=beam.length_m - p.centre_m) for p in beam.patches]
    return replace(beam, supports=beam.supports[::-1], patches=tuple(patches))


@pytest.mark.parametrize("damping", [1e-6, 0.005, 0.2])
@pytest.mark.parametrize("support", HELD)
def test_what_is_held_has_the_direction_in_which_it_leaves_its_end(
    support: Support, damping: float
) -> None:
    """There W and ψ leave 0 with a sign, however few digits of them are left.

    Of a pinned end -Wψ is below 0; of a clamped one W is shear, and either may be.
    """
    width_m = np.array([10.0**n for n in range(-12, -6)])
    ways = set()
    for supports in ((support, "free"), (support, support), (support, "pinned")):
        patch = replace(Patch(), centre_m=0.06, faces="upper")
        beam = Beam(supports=supports, damping_ratio=damping, patches=(patch,))
        for frequency_hz in np.geomspace(200.0, 90e3, 5).tolist():
            waves = Waves(beam, frequency_hz, damping).solve()
            w, psi = waves.state(width_m / 2)
            moves_right = (-(w * psi.conj()).real > 0).astype(float)
            right, mean = _right_and_mean(beam, frequency_hz, width_m, width_m)
            np.testing.assert_array_equal(right, moves_right)
            assert (mean >= 0).all()
            ways.add(right[0])
            ends_m = np.full(4, beam.length_m)
            right, _ = _right_and_mean(_turned(beam), frequency_hz, ends_m, width_m[2:])
            np.testing.assert_allclose(right, 1 - moves_right[0], atol=1e-6)
    assert ways == ({0.0} if support == "pinned" else {0.0, 1.0})


def test_a_window_without_a_width_is_the_limit() -> None:
    for supports in (("clamped", "free"), ("free", "clamped"), ("pinned", "free")):
        field = _field(Beam(supports=supports), 9000.0)
        limit, narrow = (field.pattern.window(np.array([x]), 0.01) for x in (0.0, 1e-10))
        assert limit.right == narrow.right
        np.testing.assert_allclose(limit.mean, narrow.mean, atol=1e-7)


@pytest.mark.parametrize("damping", [1e-12, 1e-9, 1e-6])
def test_motion_that_vanishes_at_a_place_has_a_corner_there(damping: float) -> None:
    """Of a motion in one phase |W| is 0 exactly at its nodes."""
    beam = Beam(damping_ratio=damping)
    frequency_hz = 14_000.0
    waves = Waves(beam, frequency_hz, damping).solve()
    nodes_m = waves.roots(lambda state: state[0].real)
    nodes_m = nodes_m[(nodes_m > 1e-3) & (nodes_m < 0.099)]
    assert nodes_m.size > 3
    for width_m in (1e-9, 1e-7, 1e-5, 1e-3):
        x_m = np.concatenate([nodes_m, nodes_m + width_m / 2, nodes_m + width_m])
        ours = _right_and_mean(beam, frequency_hz, x_m, width_m)
        right_m, area = waves.under(x_m, np.full(x_m.size, width_m))
        # The place of a node is known to some 1e-11 m, and an integral to the last digit of .1.
        np.testing.assert_allclose(ours[0], right_m / width_m, atol=1e-9 + 1e-10 / width_m)
        exact = area / width_m / waves.rms()[0]
        np.testing.assert_allclose(ours[1], exact, atol=1e-8 + 5e-17 / width_m)


PATCH = replace(Patch(), length_m=0.02)
WHERE = {
    "from a support": (replace(PATCH, centre_m=0.01),),
    "to the tip": (replace(PATCH, centre_m=0.09),),
    "over everything": (replace(PATCH, centre_m=0.05, length_m=0.1),),
    "1 um apart": (
        replace(PATCH, centre_m=0.05),
        replace(PATCH, centre_m=0.070001, faces="upper"),
    ),
    "each on its face, one above the other": (
        replace(PATCH, centre_m=0.05, faces="upper"),
        replace(PATCH, centre_m=0.055, faces="lower", thickness_m=1e-3),
    ),
    "of 2 um": (replace(PATCH, centre_m=0.05, length_m=2e-6), replace(PATCH, centre_m=0.08)),
}


@pytest.mark.parametrize("faces", ["both", "upper"])
@pytest.mark.parametrize("where", WHERE)
def test_patches_may_lie_anywhere(where: str, faces: Any) -> None:
    patches = (replace(WHERE[where][0], faces=faces), *WHERE[where][1:])
    if where.startswith("each"):
        patches = WHERE[where]
    # Two clamped ends do not turn, and a patch over everything does no work on them.
    last = "free" if where == "over everything" else "clamped"
    for supports in (("clamped", "free"), ("free", "pinned"), ("clamped", last)):
        beam = Beam(supports=supports, patches=patches)
        frequency_hz = 1.001 * natural_frequency_hz(beam, 4)
        waves = Waves(beam, frequency_hz, beam.damping_ratio).solve()
        field = _field(beam, frequency_hz)
        rms, turn = waves.rms()
        assert field.displacement_m[0] == pytest.approx(float(rms), rel=1e-9)
        assert field.rotation[0] == pytest.approx(float(turn), rel=1e-9)
        x_m = np.linspace(1e-3, beam.length_m, 40)
        right_m, area = waves.under(x_m, np.full(40, 5e-3))
        window, width_m = field.pattern.window(x_m, 5e-3), np.minimum(x_m, 5e-3)
        np.testing.assert_allclose(window.right, right_m / width_m, atol=1e-7)
        np.testing.assert_allclose(window.mean, area / width_m / rms, atol=3e-7)


@pytest.mark.parametrize(
    ("patches", "message"),
    [
        (
            (PATCH, replace(PATCH, centre_m=PATCH.centre_m - 0.01, faces="lower")),
            "patch centre_m must not overlap the one to its left, which ends at 0.086 m",
        ),
        ((replace(PATCH, length_m=1e-9),), "patch length_m must be at least 1e-05 of the beam's"),
        (
            (replace(PATCH, centre_m=0.095),),
            "patch, 0.02 m long, lies on the beam, from 0 to 0.1 m, got 0.095",
        ),
        ((replace(PATCH, centre_m=0.004),), "lies on the beam, from 0 to 0.1 m, got 0.004"),
        ((replace(PATCH, width_m=0.006),), "patch width_m must be at most the beam's, 0.005, got"),
    ],
)
def test_patches_that_cannot_be_are_refused(patches: tuple[Patch, ...], message: str) -> None:
    with pytest.raises(OutOfRangeError, match=re.escape(message)):
        Beam(patches=patches)


def test_joints_that_differ_by_rounding_are_one() -> None:
    """In binary .09 + .01 is not .1, and .03 + .01 not .04."""
    assert 0.09 + 0.01 < 0.1
    to_tip = Patch(centre_m=0.095 - 2e-17, length_m=0.01)
    assert to_tip.end_m != 0.1 or to_tip.start_m != 0.09
    pair = tuple(Patch(centre_m=c, length_m=0.01) for c in (0.035, 0.045 + 1e-17, 0.1 - 0.005))
    beam = Beam(patches=pair)
    assert len(beam.sections()) == 5
    assert beam.sections()[-1].end_m == 0.1
    assert np.isfinite(_field(beam, 9000.0).displacement_m).all()
    almost = replace(beam, patches=(replace(pair[0], length_m=0.01 + 1e-15), *pair[1:]))
    assert len(almost.sections()) == 5
    assert natural_frequency_hz(almost, 6) == pytest.approx(natural_frequency_hz(beam, 6))


def test_elements_are_fine_enough_for_every_drive_whatever_others_there_are() -> None:
    beam = Beam()
    frequency_hz = np.geomspace(20.0, beam.cut_off_hz, 60)
    reach_hz = fine_to_hz(beam, frequency_hz)
    assert (reach_hz >= frequency_hz).all()
    assert (reach_hz[frequency_hz > 5e3] <= math.sqrt(2) * frequency_hz[frequency_hz > 5e3]).all()
    damping = np.full(60, 0.005)
    together = np.empty((2, 60))
    for which, field in driven_fields(beam, frequency_hz, damping):
        window = field.pattern.chosen(np.arange(which.size)).window(np.full(which.size, 0.06), 0.01)
        together[:, which] = field.displacement_m, window.mean
    for drive in (0, 17, 43, 59):
        field = _field(beam, float(frequency_hz[drive]))
        mean = field.pattern.window(np.array([0.06]), 0.01).mean
        np.testing.assert_allclose([field.displacement_m, mean], together[:, [drive]], rtol=1e-11)


def test_a_drive_above_the_cut_off_is_refused() -> None:
    beam = Beam(frequency_scale=0.5)
    with pytest.raises(OutOfRangeError, match="frequency_hz must be at most the beam's cut-off"):
        _field(beam, 0.51 * Beam().cut_off_hz)
    assert _field(beam, 0.49 * Beam().cut_off_hz).displacement_m > 0


def test_up_to_the_cut_off_the_motion_is_that_of_exact_waves() -> None:
    beam = Beam(supports=("clamped", "clamped"))
    for part in (0.9, 0.999, 1.0):
        waves = Waves(beam, part * beam.cut_off_hz, beam.damping_ratio).solve()
        field = _field(beam, part * beam.cut_off_hz)
        assert field.displacement_m[0] == pytest.approx(float(waves.rms()[0]), rel=1e-8)


def test_far_below_the_first_mode_the_patches_bend_the_beam_statically() -> None:
    """A moment on a free end's part turns what is beyond it by M l/EI."""
    beam = Beam(damping_ratio=1e-9, patches=(replace(PATCH, thickness_m=1e-9, centre_m=0.03),))
    field = _field(beam, 0.01)
    (_, section, _) = beam.sections()
    tip_turn = section.moment_n_m_per_v * 0.02 / section.bending_n_m2
    x = np.linspace(0.0, 0.1, 100_001)
    turn = tip_turn * np.clip((x - 0.02) / 0.02, 0.0, 1.0)
    assert field.rotation[0] == pytest.approx(np.sqrt(np.mean(turn**2)), rel=1e-4)


@pytest.mark.parametrize("seed", [1104, 1136, 1183])
def test_modes_of_shear_take_no_part_in_slender_beams(seed: int) -> None:
    """Their numbers are rounding, which turned sections by 1e-4 of the largest rotation."""
    assert random_beam(np.random.default_rng(seed)).thickness_m < 1e-3 * 0.4
    errors = compared(seed)
    assert errors["consistent"] < 1e-7
    assert errors["coulomb"] < 1e-7


def test_a_scaled_beam_moves_as_one_of_scaled_stiffness() -> None:
    scale = 1.07
    beam = Beam(frequency_scale=scale)
    waves = Waves(beam, 9_000.0, beam.damping_ratio).solve()
    field = _field(beam, 9_000.0)
    assert field.displacement_m[0] == pytest.approx(float(waves.rms()[0]), rel=1e-9)
    stiff = replace(
        Beam(),
        youngs_modulus_pa=105e9 * scale**2,
        patches=(replace(Patch(), youngs_modulus_pa=76.5e9 * scale**2),),
    )
    other = _field(stiff, 9_000.0)
    assert field.displacement_m[0] == pytest.approx(float(other.displacement_m[0]), rel=1e-9)


def test_the_neutral_axis_of_a_sheet_on_one_face_moves() -> None:
    """Against the stiffness of a laminate of two layers, by its classical formula."""
    patch = replace(Patch(), centre_m=0.05, length_m=0.1, faces="upper", width_m=5e-3)
    beam = Beam(patches=(patch,))
    (section,) = beam.sections()
    e1, t1, e2, t2, width = 105e9, 5e-3, 76.5e9, 0.3e-3, 5e-3
    a, b = e1 * t1, e2 * t2
    laminate = (a * t1**2 + b * t2**2) / 12 + a * b / (a + b) * ((t1 + t2) / 2) ** 2
    assert section.bending_n_m2 == pytest.approx(width * laminate, rel=1e-12)
    lever = (t1 + t2) / 2 * a / (a + b)
    assert section.moment_n_m_per_v == pytest.approx(2.0 * 5e-3 * lever, rel=1e-12)


def test_finer_cells_and_pieces_come_nearer_to_exact_waves() -> None:
    draw = np.random.default_rng(3)
    beam = random_beam(draw)
    frequency_hz = random_drive_hz(beam, draw)
    waves = Waves(beam, frequency_hz, beam.damping_ratio).solve()
    x_m = np.linspace(0.1, 1.0, 60) * beam.length_m
    _, area = waves.under(x_m, np.full(60, 0.01 * beam.length_m))
    exact = area / (0.01 * beam.length_m) / waves.rms()[0]
    errors = [
        np.abs(
            _field(beam, frequency_hz, fineness).pattern.window(x_m, 0.01 * beam.length_m).mean
            - exact
        ).max()
        for fineness in (Fineness(Mesh(), 3, 1.0), Fineness(Mesh(), 8, 0.6), FINENESS)
    ]
    assert errors[0] > 10 * errors[1] > 100 * errors[2]
    assert errors[2] < 1e-7


def test_exact_waves_are_the_closed_form_of_a_pinned_beam() -> None:
    """So that the reference has one of its own: n half waves of an Euler beam."""
    beam = Beam(supports=("pinned", "pinned"), patches=())
    for mode in (1, 5):
        own_hz = beam.bare.frequency_hz(mode * math.pi / beam.length_m)
        exact = exact_waves.natural_frequency(beam, own_hz)
        assert own_hz == pytest.approx(float(exact), rel=1e-13)
