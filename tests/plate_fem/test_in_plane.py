"""Modes within the plane: plane stress beside published frequencies, fields that are known, plates without."""

import numpy as np
import pytest
import scipy.linalg
from plates import STEEL, four_rods, plate, rod

from plate_fem.elements.system import first_Hz_of, in_plane
from plate_fem.modes import plate_modes, surface_stress_rows
from plate_fem.solution.model import build_model

THICK = {"size_m": [0.3, 0.3], "thickness_m": 0.06, "max_frequency_Hz": 10e3,
         "rods": [rod(a * 0.1, b * 0.1, diameter_m=0.03) for a in (-1, 1) for b in (-1, 1)]}


@pytest.fixture(scope="module")
def thick():
    return build_model(plate(**THICK)).system


def test_free_square_has_published_frequencies(thick):
    """Bardell, Langley and Dunsdon 1996, J. Sound Vib. 191:459, of omega L sqrt(rho (1 - nu^2)/E)."""
    stiffness, mass = (matrix.toarray() for matrix in thick.in_plane.matrices())
    squared = scipy.linalg.eigh(stiffness, mass, eigvals_only=True, subset_by_index=[0, 8])
    factor = 0.3 * np.sqrt(STEEL["density_kg_m3"] * (1 - 0.3**2) / STEEL["youngs_modulus_Pa"])
    assert np.sqrt(abs(squared[:3])).max() * factor < 1e-3  # sways and yaws
    assert np.sqrt(squared[3:]) * factor == pytest.approx([2.321, 2.472, 2.472, 2.628, 2.987, 3.452], rel=1e-3)
    assert first_Hz_of(plate(**THICK)) * 2 * np.pi * factor == pytest.approx(2.321, rel=0.02)


def test_stretched_and_turned_plate_moves_turns_and_is_stressed_as_its_field_says(thick):
    """u = (a x - b y, b x + c y): strain a, c and none, turn b."""
    a, b, c, points = 2e-4, 3e-4, -1e-4, np.array([[0.03, -0.11], [0.15, 0.15], [-0.07, 0.02]])
    u = np.zeros(thick.size)
    for axis, field in ((0, points @ [a, -b]), (1, points @ [b, c])):
        inside, fine = thick.in_plane, np.random.default_rng(2).uniform(-0.15, 0.15, (4000, 2))
        first, size = axis * inside.functions[0].size, inside.functions[axis].size
        rows, start = inside.displacement(fine, axis)[:, first : first + size], thick.size - inside.size + first
        wanted = fine @ ([a, -b] if axis == 0 else [b, c])
        u[start : start + size] = np.linalg.lstsq(rows.toarray(), wanted, rcond=None)[0]
        assert thick.lateral(points, axis, 0.03) @ u == pytest.approx(field, abs=1e-12)
    assert thick.yaw(points) @ u == pytest.approx(3 * [b])
    stress = np.column_stack([rows @ u for rows in surface_stress_rows(thick, points)])
    nu, modulus = STEEL["poisson_ratio"], STEEL["youngs_modulus_Pa"]
    expected = modulus / (1 - nu**2) * np.array([a + nu * c, c + nu * a, 0])
    assert stress == pytest.approx(np.broadcast_to(expected, stress.shape), abs=1e-6 * expected[0])


@pytest.mark.slow
def test_a_thick_plate_has_the_modes_of_its_stretch_beside_those_of_bending(monkeypatch):
    """As many below 9 kHz as the square alone, which the mass of rods lowers a little. Low modes of bending stay."""
    found, half_m = plate_modes(plate(**THICK)), 0.03
    monkeypatch.setattr("plate_fem.elements.system.first_is_low", lambda plate: False)
    rigid = plate_modes(plate(**THICK))
    along = abs(found.lateral + half_m * found.nodal[1:3].transpose(1, 0, 2)).max(axis=(0, 1))
    flat = found.frequency_Hz[(abs(found.shape).max(axis=0) < 0.2 * along) & (found.frequency_Hz < 9e3)]
    alone = np.array([2.321, 2.472, 2.472, 2.628, 2.987]) * np.sqrt(2.07e11 / 7830 / (1 - 0.3**2)) / (2 * np.pi * 0.3)
    assert flat[3:] / alone == pytest.approx(0.98, abs=0.02)  # after two sways and the yaw
    assert found.frequency_Hz[:11] == pytest.approx(rigid.frequency_Hz[:11], rel=2e-3)


@pytest.mark.parametrize("changes, expected", [
    (THICK, True), ({"size_m": [0.75, 0.1], "thickness_m": 0.01, "max_frequency_Hz": 3e3,
                     "rods": [rod(0.3, 0.0)]}, True),
    ({"rods": four_rods()}, False), ({**THICK, "max_frequency_Hz": 6e3}, False), ({**THICK, "rods": []}, False),
    ({**THICK, "edges": "clamped"}, False)])
def test_only_plates_on_rods_whose_first_is_low_stretch(changes, expected):
    assert (in_plane(plate(**changes)).functions is not None) is expected
