"""Plate on four rods against a 3D solid model (CalculiX), which knows nothing of plate theory."""

import shutil

import numpy as np
import pytest
from plates import STEEL, four_rods, plate, rod
from scipy.integrate import trapezoid
from solid import Part, _faces, solid_modes, unlike_rods_modes

from lab.plate.solids import PLATES
from plate_fem.modes import plate_modes


def overlap(part):
    """Share of the plate's area that its faces have too much."""
    ring = np.concatenate(_faces(part)[0])[:, [0, 4, 1, 5, 2, 6, 3, 7]]  # corners and middles in their order
    after, sides = np.roll(ring, -1, axis=1), np.diff([part.x_m, part.y_m]).ravel()
    return (ring[..., 0] * after[..., 1] - ring[..., 1] * after[..., 0]).sum() / 2 / sides.prod() - 1


@pytest.mark.parametrize("name", sorted(PLATES))
def test_faces_of_a_solid_fill_its_plate_once(name):
    assert abs(overlap(PLATES[name].part(1))) < 1e-9


def test_rods_whose_strips_overlap_are_no_solid():
    """Its modes are some per cent off, and nothing else tells."""
    rods = ((-0.2, -0.1, 0.02), (0.1, -0.08, 0.02))
    assert overlap(Part((-0.3, 0.3), (-0.2, 0.2), 0.02, rods, 0.1, STEEL, 0.03)) > 1e-3


def bending_modes(folder, diameter_m, fine):
    """(frequency (n,), [(node_m, w)]) of the solid's modes that move mostly vertically, and the others' Hz."""
    bending, other = [], []
    for symmetry in ("ss", "sa", "aa"):  # "as" repeats "sa", turned by 90 degrees
        found = solid_modes(folder, 0.25, 0.02, 0.2, diameter_m, 0.1, STEEL, symmetry, 10, fine)
        for frequency, motion in zip(found[0], found[2], strict=True):
            vertical = np.sum(motion[:, 2] ** 2) > np.sum(motion[:, :2] ** 2)
            (bending if vertical else other).append((frequency, symmetry, found[1], motion[:, 2]))
    return sorted(bending, key=lambda mode: mode[0]), sorted(mode[0] for mode in other)


def likeness(node_m, w, modes, chosen):
    """Share of w (k,) that the chosen modes can represent, 0 to 1 (MAC for a subspace)."""
    shape = modes.shape_at(node_m)[:, chosen]
    fitted = shape @ np.linalg.lstsq(shape, w, rcond=None)[0]
    return (fitted @ fitted) / (w @ w)


@pytest.mark.validate
@pytest.mark.skipif(shutil.which("ccx") is None, reason="needs Debian's calculix-ccx")
@pytest.mark.parametrize("diameter_m", [0.016, 0.02, 0.024])
def test_first_ten_bending_modes_within_two_percent_of_the_solid(tmp_path, diameter_m):
    solid, in_plane = bending_modes(tmp_path, diameter_m, fine=1)
    modes = plate_modes(plate(rods=four_rods(diameter_m=diameter_m), max_frequency_Hz=3e3))
    number, differences = 0, []
    for frequency, symmetry, node_m, w in solid:
        chosen = np.flatnonzero(abs(modes.frequency_Hz / frequency - 1) < 0.02)
        assert likeness(node_m, w, modes, chosen) > 0.98, f"{frequency} Hz has no likeness within 2 %"
        nearest = chosen[abs(modes.frequency_Hz[chosen] - frequency).argmin()]
        differences.append(modes.frequency_Hz[nearest] / frequency - 1)
        number += 2 if symmetry == "sa" else 1
        if number >= 10:
            break
    assert number >= 10
    assert max(abs(np.array(differences))) < 0.015
    for frequency in in_plane[:2]:  # sway, which is double, and yaw
        nearest = abs(modes.frequency_Hz - frequency).argmin()
        assert modes.frequency_Hz[nearest] == pytest.approx(frequency, rel=0.01)
        assert abs(modes.shape[:, nearest]).max() < 0.3 * abs(modes.shape).max()


@pytest.mark.validate
@pytest.mark.skipif(shutil.which("ccx") is None, reason="needs Debian's calculix-ccx")
def test_solid_is_converged(tmp_path):
    coarse, fine = (bending_modes(tmp_path, 0.02, n)[0] for n in (1, 2))
    for a, b in zip(coarse[:8], fine[:8], strict=True):
        assert a[0] == pytest.approx(b[0], rel=2.5e-3)


@pytest.mark.validate
@pytest.mark.skipif(shutil.which("ccx") is None, reason="needs Debian's calculix-ccx")
def test_plate_on_unlike_rods_is_that_of_the_solid(tmp_path):
    """Sway and yaw mix with heave and tilt there. Modes to 2.7 kHz, and the motion of the centre after an impact."""
    half_m, place_m, diameters_m = (0.3, 0.2), (0.24, 0.14), (0.016, 0.02, 0.024, 0.03)
    frequency, node_m, motion = unlike_rods_modes(tmp_path, half_m, 0.03, place_m, diameters_m, 0.1, STEEL, 16)
    signs = [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    rods = [rod(a * place_m[0], b * place_m[1], diameter_m=d) for (a, b), d in zip(signs, diameters_m, strict=True)]
    modes = plate_modes(plate(size_m=[0.6, 0.4], thickness_m=0.03, rods=rods, max_frequency_Hz=2720.0))
    assert modes.frequency_Hz == pytest.approx(frequency, rel=0.01)
    centre, hit = (np.hypot(*(node_m - place).T).argmin() for place in ((0, 0), (0.12, 0.08)))
    shape = modes.shape_at(node_m[[centre, hit]])
    solid = after_a_pulse(frequency, motion[:, centre, 2] * motion[:, hit, 2])
    plate_w = after_a_pulse(modes.frequency_Hz, shape[0] * shape[1])
    assert np.sqrt(np.mean(plate_w**2)) == pytest.approx(np.sqrt(np.mean(solid**2)), rel=0.01)
    assert np.sqrt(np.mean((plate_w - solid) ** 2)) < 0.05 * np.sqrt(np.mean(solid**2))


def after_a_pulse(frequency_Hz, product):
    """Undamped deflection over 10 ms after a half sine of 1 N and 250 us; product: of the shapes at both places."""
    t, tau = np.linspace(0, 0.01, 2001)[:, None], np.linspace(0, 250e-6, 200)[None]
    force = np.sin(np.pi * tau / 250e-6)
    response = [a / w * trapezoid(force * np.where(t > tau, np.sin(w * (t - tau)), 0), tau[0], axis=1)
                for w, a in zip(2 * np.pi * frequency_Hz, product, strict=True)]
    return np.sum(response, axis=0)
