"""Stress under contacts against known values and an independent surface solution."""

import math

import numpy as np
import pytest
from plates import plate

from plate_fem.modes import plate_modes
from plate_fem.stress import YIELD_PRESSURE, HertzContact, contact_surface_stress, total_stress, von_mises, von_mises_3d

# Gangue of the paper's Table 1 at 3 m/s: K = 2.1763e9 N/m^1.5 = 4/3 E* sqrt(R), 7646.3 N, p0 632 MPa.
GANGUE = HertzContact(0.0, 0.0, 7646.3, 0.025, 0.75 * 2.1763e9 / math.sqrt(0.025))
COAL = HertzContact(0.0, 0.0, 4261.6, 0.025, 0.75 * 1.1575e9 / math.sqrt(0.025))


def test_peak_pressure_of_the_notes():
    assert pytest.approx(632e6, rel=2e-3) == GANGUE.peak_pressure_Pa
    assert pytest.approx(341e6, rel=2e-3) == COAL.peak_pressure_Pa
    # approach = a^2 / R is the 231.1 um of the notes
    assert pytest.approx(231.1e-6, rel=1e-3) == GANGUE.contact_radius_m**2 / 0.025


def test_yield_begins_at_the_pressure_of_the_notes():
    """At 345 MPa gangue yields from 2.1 m/s, coal from about 10 m/s; p0 goes like speed^(2/5)."""
    limit_Pa = YIELD_PRESSURE * 345e6
    assert COAL.peak_pressure_Pa < limit_Pa < GANGUE.peak_pressure_Pa
    scale = (limit_Pa / GANGUE.peak_pressure_Pa) ** 2.5
    assert 3 * scale == pytest.approx(2.1, abs=0.05)


def test_centre_edge_and_outside():
    a, p0, nu = GANGUE.contact_radius_m, GANGUE.peak_pressure_Pa, 0.3
    centre, edge, far = contact_surface_stress(GANGUE, [[0, 0], [a, 0], [0, 3 * a]], nu) / p0
    assert centre == pytest.approx([-(1 + 2 * nu) / 2] * 2 + [0, -1], abs=1e-9)
    assert edge == pytest.approx([(1 - 2 * nu) / 3, -(1 - 2 * nu) / 3, 0, 0], abs=1e-9)
    assert far == pytest.approx([-(1 - 2 * nu) / 27, (1 - 2 * nu) / 27, 0, 0], abs=1e-9)


def test_whole_numbers_are_a_point_and_a_pull_is_no_contact():
    assert contact_surface_stress(HertzContact(0, 0, 10.0, 0.025, 5e9), [0, 0], 0.3).shape == (1, 4)
    assert HertzContact(0, 0, -5.0, 0.025, 5e9).contact_radius_m == 0


def test_surface_stress_is_in_equilibrium_with_the_in_plane_strain_of_the_pressure():
    """At the surface of a half-space sx + sy = -(1 + 2 nu) p, p the local pressure (Johnson 1985, 3.2)."""
    points = np.random.default_rng(0).uniform(-4e-3, 4e-3, (300, 2))
    stress = contact_surface_stress(GANGUE, points, 0.3)
    assert stress[:, 0] + stress[:, 1] == pytest.approx(1.6 * stress[:, 3], abs=1e-6 * GANGUE.peak_pressure_Pa)
    turned = contact_surface_stress(GANGUE, points @ np.array([[0, 1], [-1, 0]]), 0.3)  # by 90 degrees
    assert turned[:, [1, 0]] == pytest.approx(stress[:, :2], abs=1.0)
    assert turned[:, 2] == pytest.approx(-stress[:, 2], abs=1.0)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.97, 2.0])
@pytest.mark.parametrize("angle", [0.3, 2.0, -0.7])
def test_stress_turns_as_a_tensor(share, angle):
    """Along x the principal axes are those of the plate; elsewhere they point from the contact's middle."""
    r = share * GANGUE.contact_radius_m
    along, elsewhere = contact_surface_stress(GANGUE, [[r, 0], [r * math.cos(angle), r * math.sin(angle)]], 0.3)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    expected = turn @ np.diag(along[:2]) @ turn.T
    assert along[2] == 0
    assert elsewhere == pytest.approx([expected[0, 0], expected[1, 1], expected[0, 1], along[3]], rel=1e-6, abs=100.0)


def test_von_mises_in_space_by_principal_stresses():
    """Of turned principal stresses 300, 100 and, upwards, -50 MPa."""
    for angle in (0.0, 0.4, math.pi / 4):
        c, s = math.cos(angle), math.sin(angle)
        stress = [300 * c**2 + 100 * s**2, 300 * s**2 + 100 * c**2, 200 * c * s, -50]
        assert von_mises_3d(stress) == pytest.approx(math.sqrt((200**2 + 150**2 + 350**2) / 2))


def test_pressure_carries_the_force():
    s = (np.arange(800) + 0.5) / 800 * 6e-3 - 3e-3
    points = np.stack(np.meshgrid(s, s), axis=-1).reshape(-1, 2)
    pressure = -contact_surface_stress(GANGUE, points, 0.3)[:, 3]
    assert pressure.sum() * (6e-3 / 800) ** 2 == pytest.approx(7646.3, rel=1e-4)


def test_no_force_no_stress():
    silent = HertzContact(0.0, 0.0, 0.0, 0.025, 1e10)
    assert np.all(contact_surface_stress(silent, [[0, 0], [1e-3, 0]], 0.3) == 0)
    assert silent.peak_pressure_Pa == 0


@pytest.fixture(scope="module")
def modes():
    return plate_modes(plate(edges="simply_supported", max_frequency_Hz=1500.0))


def test_total_is_bending_plus_contacts(modes):
    amplitude = np.linspace(1, 2, len(modes.frequency_Hz)) * 1e-4
    at = modes.node_m[::7]
    bending = total_stress(modes, amplitude, [], at, 0.3)
    assert von_mises_3d(bending) == pytest.approx(von_mises(modes.surface_stress[::7] @ amplitude))
    both = total_stress(modes, amplitude, [GANGUE, COAL], at, 0.3)
    apart = contact_surface_stress(GANGUE, at, 0.3) + contact_surface_stress(COAL, at, 0.3)
    assert both == pytest.approx(bending + apart)
