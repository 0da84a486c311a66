"""Elastic-plastic contact against Thornton's closed form of the restitution, and its own energies."""

import math

import numpy as np
import pytest
from plasticity import PlasticContact
from scipy.integrate import quad

from plate_fem.stress import HertzContact

R, MASS = 0.025, 0.15708  # gangue of the paper's Table 1
MODULUS = 0.75 * 2.1763e9 / math.sqrt(R)
LAW = PlasticContact(R, MODULUS, 1.6 * 345e6)


def thornton(speed):
    """Thornton 1997, Eq. 40: restitution as a function of yield speed over impact speed."""
    v_y = (math.pi / (2 * MODULUS)) ** 2 * math.sqrt(8 * math.pi * R**3 / (15 * MASS)) * LAW.yield_pressure_Pa**2.5
    q = v_y / speed
    if q >= 1:
        return 1.0
    return (
        math.sqrt(6 * math.sqrt(3) / 5) * math.sqrt(1 - q**2 / 6) * (q / (q + 2 * math.sqrt(1.2 - 0.2 * q**2))) ** 0.25
    )


@pytest.mark.parametrize("speed", [0.5, 2.2, 3.0, 6.0, 30.0])
def test_restitution_is_thorntons(speed):
    assert LAW.restitution(MASS, speed) == pytest.approx(thornton(speed), rel=1e-6)


def test_it_is_hertz_up_to_the_yield_pressure():
    d = LAW.yield_deformation_m
    assert HertzContact(0, 0, LAW.yield_force_N, R, MODULUS).peak_pressure_Pa == pytest.approx(1.6 * 345e6)
    assert LAW.loading_N(0.7 * d) == pytest.approx(4 / 3 * MODULUS * math.sqrt(R) * (0.7 * d) ** 1.5)
    assert LAW.unloading_N(0.3 * d, 0.9 * d) == LAW.loading_N(0.3 * d)
    assert LAW.dissipated_J(d) == 0
    assert LAW.restitution(MASS, 1.0) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("times", [1.0001, 2.0, 20.0])
def test_force_is_continuous_and_the_loop_encloses_the_energy_lost(times):
    largest = times * LAW.yield_deformation_m
    assert LAW.unloading_N(largest, largest) == pytest.approx(LAW.loading_N(largest), rel=1e-9)
    assert 0 <= LAW.permanent_m(largest) < largest
    assert LAW.unloading_N(LAW.permanent_m(largest), largest) == 0
    loop = quad(LAW.loading_N, 0, largest, points=[LAW.yield_deformation_m])[0]
    loop -= quad(lambda d: LAW.unloading_N(d, largest), LAW.permanent_m(largest), largest)[0]
    assert LAW.dissipated_J(largest) == pytest.approx(loop, rel=1e-6, abs=1e-9)


def test_more_speed_less_rebound():
    restitution = [LAW.restitution(MASS, v) for v in np.linspace(0.5, 20, 40)]
    assert np.all(np.diff(restitution) <= 1e-12)
