from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lsim

from analysis import RecordError
from analysis.real_plate import amplitude_at_peak, modes_of, static_compliance_m_N
from tests.analysis.synthetic import SCENE

SIDE_M, THICKNESS_M, E_PA, NU = 0.4, 0.004, 2.07e11, 0.3


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A simply supported thin square plate, and a force stream with a gap."""
    table = {
        "model": "flexible", "theory": "kirchhoff", "edges": "simply_supported", "length_m": SIDE_M,
        "width_m": SIDE_M, "thickness_m": THICKNESS_M, "density_kg_m3": 7830.0, "youngs_modulus_Pa": E_PA,
        "poisson_ratio": NU, "max_frequency_Hz": 8000.0, "damping_ratio": 0.02, "mesh_size_m": 0.02,
    }  # fmt: skip
    path = tmp_path_factory.mktemp("runs") / "ratio_000"
    return SimpleNamespace(path=path, info={"scene": {"plate": table}})


@pytest.fixture(scope="module")
def modes(run):
    return modes_of(run)


def test_static_compliance_is_timoshenkos(modes):
    """Central load on a simply supported square plate: w = 0.01160 P a^2 / D."""
    rigidity = E_PA * THICKNESS_M**3 / (12 * (1 - NU**2))
    found = static_compliance_m_N(modes, np.array([[0.0, 0.0]]))
    assert found[0] == pytest.approx(0.01160 * SIDE_M**2 / rigidity, rel=0.01)


def test_compliance_is_symmetric_and_falls_to_the_edge(modes):
    x = np.array([0.0, 0.05, 0.1, 0.15])
    along = static_compliance_m_N(modes, np.column_stack([x, 0 * x]))
    np.testing.assert_allclose(static_compliance_m_N(modes, np.column_stack([0 * x, -x])), along, rtol=1e-6)
    assert np.all(np.diff(along) < 0)


def test_replayed_plate_equals_an_ordinary_integration(modes, run):
    """Forces at two places, piecewise constant, with rows missing while nothing touches."""
    dt_s, n = 1e-5, 120
    t = np.arange(n) * dt_s
    force = np.zeros((n, 2))
    force[10:30, 0] = 800.0
    force[70:95, 1] = np.linspace(0, 2000.0, 25)
    kept = force.any(axis=1)
    kept[[0, 9, 30, 69, 95, n - 1]] = True
    fast = pd.DataFrame({"t_s": t, "force_01_N": force[:, 0], "force_02_N": force[:, 1]})[kept]
    places = np.array([[0.03, 0.02], [-0.1, 0.05]])
    found = amplitude_at_peak(modes, SimpleNamespace(path=run.path, fast=fast), places)
    peak = int(np.argmax(force.sum(axis=1)))
    shapes = modes.shape_at(places)
    for k in range(0, modes.frequency_Hz.size, 5):
        w, z = 2 * np.pi * modes.frequency_Hz[k], modes.damping_ratio[k]
        fine = np.arange(peak * 20 + 1) * dt_s / 20
        row = np.minimum(
            np.ceil(fine / dt_s - 1e-9).astype(int), n - 1
        )  # a row's force acts over its interval
        q = lsim(
            ([[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[1, 0]], [[0]]), -force[row] @ shapes[:, k], fine
        )[1]
        assert found[k] == pytest.approx(q[-1], rel=0.03, abs=0.01 * np.abs(q).max())


def test_rigid_plate_has_no_modes(run):
    with pytest.raises(RecordError, match="flexible"):
        modes_of(SimpleNamespace(path=run.path, info={"scene": SCENE}))
