"""Plates and forces that no model was made of."""

from types import SimpleNamespace

import numpy as np
import pytest

from common.resources import resource
from recognition.evaluation.force_pulses import ForcePulses, hertz_pulse
from recognition.evaluation.other_plates import other_theory, scattered, solid_plate
from recognition.plate.plate_model import PlateModel

SCENE = resource("scenes") / "paper.toml"
MASS_kg = 39.15
STEEL = SimpleNamespace(density_kg_m3=7830.0, youngs_modulus_Pa=2.07e11, poisson_ratio=0.3)
COAL = SimpleNamespace(density_kg_m3=1380.0, youngs_modulus_Pa=5.12e9, poisson_ratio=0.3)


@pytest.fixture(scope="module")
def plate():
    return PlateModel.from_scene(SCENE, 2500.0)


def bending(model, below_Hz=2000.0):
    """Frequencies of the modes that move the plate vertically."""
    return model.frequency_Hz[(model.rms_shape**2 * MASS_kg > 0.3) & (model.frequency_Hz < below_Hz)]


def test_solid_is_the_same_plate(plate):
    """CalculiX knows nothing of plate theory: frequencies within 0.5 %, and the same compliance at the sensors."""
    solid = solid_plate(plate)
    assert bending(solid) == pytest.approx(bending(plate), rel=5e-3)
    kept, all_ = plate.frequency_Hz < 2000, solid.frequency_Hz < 2000
    ours = np.sum((plate.sensor_shape / plate.frequency_Hz)[:, kept] ** 2, axis=1)
    assert np.sum((solid.sensor_shape / solid.frequency_Hz)[:, all_] ** 2, axis=1) == pytest.approx(ours, rel=0.02)


def test_other_theory_is_stiffer(plate):
    """Kirchhoff's plate has no shear: all frequencies higher, by 1 to 6 % below 2 kHz."""
    ratio = bending(other_theory(plate, SCENE), 2200.0)[: bending(plate).size] / bending(plate)
    assert np.all((ratio > 1.005) & (ratio < 1.06))


def test_scatter_is_as_asked(plate):
    rng = np.random.default_rng(1)
    draws = [scattered(plate, 0.01, rng) for _ in range(30)]
    off = np.array([np.sort(one.frequency_Hz) / plate.frequency_Hz - 1 for one in draws])
    assert np.std(off) == pytest.approx(0.01, rel=0.15)  # sorting takes a little away
    lone = 7  # no neighbour comes near
    alike = [one.grid_shape[..., lone] - plate.grid_shape[..., lone] for one in draws]
    assert np.sqrt(np.mean(np.square(alike))) / plate.rms_shape[lone] == pytest.approx(0.01, rel=1e-6)


def test_library_of_pulses_conserves_momentum():
    """The impulse of a stone lies between m v, of one that stays, and 2 m v, of one that rebounds as fast as it came."""
    pulses = ForcePulses.library()
    density = np.where(pulses.gangue, 2400.0, 1380.0)
    share = pulses.impulse_N_s / (density * 4 / 3 * np.pi * pulses.radius_m**3 * pulses.speed_m_s)
    assert np.all((share > 0.9) & (share < 2.0))
    assert {bool(rock) for rock in pulses.gangue} == {True, False}
    rate_Hz = 120e3
    force = pulses.at_rate(3, rate_Hz, 1e-3, 5e-3)
    assert force.sum() / rate_Hz == pytest.approx(pulses.impulse_N_s[3], rel=1e-9)
    assert not force[: int(1e-3 * rate_Hz)].any()


def test_hertz_pulse_is_that_of_a_sphere():
    """Peak of an elastic sphere of coal at 3 m/s on a rigid plate, docs/validation.md: 4261.6 N
    over 233.9 us."""
    force = hertz_pulse(COAL, STEEL, 0.025, 3.0, 1e6, 1e-4, 1e-3)
    assert force.max() == pytest.approx(4261.6, rel=5e-3)
    assert np.count_nonzero(force) == pytest.approx(233.9, abs=1)
