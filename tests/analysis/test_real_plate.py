from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lsim

from analysis import RecordError
from analysis.theory.contact_states import COAL, GANGUE, PLATE, contact_stiffness
from analysis.theory.real_plate import (
    amplitude_at_peak,
    contact_stress_map_Pa,
    hertz_contacts,
    modes_of,
    nodal_at,
    static_compliance_m_N,
)
from common.run_summary import RecordedScene
from common.scene.plate import FlexiblePlate
from plate_fem.modes import plate_modes
from tests.analysis.synthetic import SCENE

PLACES_M = np.array([[0.03, 0.02], [-0.1, 0.05]])
SIDE_M, THICKNESS_M, E_PA, NU = 0.4, 0.004, 2.07e11, 0.3


def run_of(path, info, **more):
    """As much of a run as the plate needs."""
    summary = SimpleNamespace(n_modes=info.get("n_modes"))
    scene = RecordedScene.model_validate(info["scene"])
    return SimpleNamespace(path=Path(path), info=info, summary=summary, scene=scene, stones=None, **more)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A simply supported thin square plate, and a force stream with a gap."""
    table = {
        "theory": "kirchhoff", "edges": "simply_supported", "size_m": [SIDE_M, SIDE_M],
        "thickness_m": THICKNESS_M, "density_kg_m3": 7830.0, "youngs_modulus_Pa": E_PA,
        "poisson_ratio": NU, "max_frequency_Hz": 8000.0, "damping_ratio": 0.02, "mesh_size_m": 0.02,
    }  # fmt: skip
    path = tmp_path_factory.mktemp("runs") / "ratio_000"
    stones = {"positions_m": [[x, y] for x, y in PLACES_M]}
    scene = {"plate": table, "stones": stones}
    n_modes = plate_modes(FlexiblePlate.model_validate(table), None, PLACES_M).frequency_Hz.size
    return run_of(path, {"scene": scene, "n_modes": n_modes})


@pytest.fixture(scope="module")
def modes(run):
    return modes_of(run)


def test_static_compliance_is_timoshenkos(modes):
    """Central load on a simply supported square plate: w = 0.01160 P a^2 / D."""
    rigidity = E_PA * THICKNESS_M**3 / (12 * (1 - NU**2))
    found = static_compliance_m_N(modes, np.array([[0.0, 0.0]]))
    assert found[0] == pytest.approx(0.01160 * SIDE_M**2 / rigidity, rel=0.01)


def test_compliance_is_symmetric_and_falls_to_the_edge(run):
    """Without residual modes, which know the stones' places."""
    modes = plate_modes(FlexiblePlate.model_validate(run.info["scene"]["plate"]))
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
    found = amplitude_at_peak(modes, run_of(run.path, run.info, fast=fast))
    peak = int(np.argmax(force.sum(axis=1)))
    shapes = modes.shape_at(PLACES_M)
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


def test_modes_are_those_the_run_counts(run, modes):
    """With residual modes at its stones, and none of another number."""
    residual = plate_modes(FlexiblePlate.model_validate(run.info["scene"]["plate"]), None, PLACES_M)
    assert modes.n_residual == residual.n_residual > 0
    np.testing.assert_allclose(modes.frequency_Hz, residual.frequency_Hz)
    with pytest.raises(RecordError, match="n_modes = 3;"):
        modes_of(run_of(run.path, run.info | {"n_modes": 3}))


def test_modes_of_a_run_of_many_stones_have_those_of_its_rods(run):
    rods = [{"place_m": [0.1 * a, 0.1 * b], "diameter_m": 0.04, "length_m": 0.1, "youngs_modulus_Pa": E_PA,
             "density_kg_m3": 7830.0} for a in (-1, 1) for b in (-1, 1)]
    plate = run.info["scene"]["plate"] | {"edges": "free", "rods": rods, "max_frequency_Hz": 500.0, "mesh_size_m": None}
    places = [[0.01 * k - 0.16, 0.0] for k in range(33)]
    kept = plate_modes(FlexiblePlate.model_validate(plate)).frequency_Hz.size
    many = {"scene": {"plate": plate, "stones": {"positions_m": places}}}
    assert modes_of(run_of(run.path, many | {"n_modes": kept + 4})).n_residual == 4


def test_cached_modes_are_taken_only_if_identical(run, modes, tmp_path, monkeypatch):
    monkeypatch.setenv("COAL_GANGUE_CACHE", str(tmp_path / "kept"))
    beside = run_of(tmp_path / "ratio_000", run.info)
    modes_of(beside)
    stored = [*(tmp_path / "kept").glob("modes-*.cache")]
    plate = run.info["scene"]["plate"] | {"thickness_m": 0.005}
    n_modes = plate_modes(FlexiblePlate.model_validate(plate), None, PLACES_M).frequency_Hz.size
    other = {"scene": run.info["scene"] | {"plate": plate}, "n_modes": n_modes}
    found = modes_of(run_of(beside.path, other))
    assert stored and all(file.exists() for file in stored) and found.frequency_Hz[0] > 1.2 * modes.frequency_Hz[0]
    np.testing.assert_array_equal(modes_of(beside).frequency_Hz, modes.frequency_Hz)


def test_stress_under_a_contact_is_hertz_and_bending(modes):
    """At the centre of a contact: sx = sy = -(1 + 2 nu) p0 / 2, sz = -p0 (Johnson 1985), so 0.2 p0 at nu 0.3."""
    forces = np.linspace(100.0, 1000.0, 10)
    run = run_of("run", {"scene": SCENE}, materials=["coal"] * 5 + ["gangue"] * 5)
    contacts = hertz_contacts(run, forces)
    for contact, force, name in zip(contacts, forces, run.materials, strict=True):
        stiffness = contact_stiffness({"coal": COAL, "gangue": GANGUE}[name], 0.025, PLATE)
        area_m2 = np.pi * 0.025 * (force / stiffness) ** (2 / 3)  # a^2 = R d
        assert contact.peak_pressure_Pa == pytest.approx(1.5 * force / area_m2, rel=1e-9)
    at_rest = np.zeros(modes.frequency_Hz.size)
    local = contact_stress_map_Pa(modes, at_rest, contacts[2:3], 1, 0.3, np.array([-0.02, 0.0, 0.02]))
    assert local[1, 1] == pytest.approx(0.2 * contacts[2].peak_pressure_Pa, rel=1e-6)
    assert local[0, 0] < 0.01 * local[1, 1]


def test_values_between_nodes_are_those_of_a_smooth_field(modes):
    x, y = modes.node_m.T
    points = np.array([[0.013, -0.07], [0.0, 0.0], [-0.101, 0.144]])

    def field(x, y):
        return np.cos(12 * x) * np.sin(9 * y + 1)

    np.testing.assert_allclose(nodal_at(modes, field(x, y), points), field(*points.T), atol=1e-4)


def test_rigid_plate_has_no_modes(run):
    with pytest.raises(RecordError, match="thickness_m = None; needs that of a plate that bends"):
        modes_of(run_of(run.path, {"scene": {"plate": {"size_m": [0.5, 0.5]}}}))
