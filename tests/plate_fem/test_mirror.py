"""Even and odd modes found apart are those of the whole plate."""

import numpy as np
import pytest
from plates import four_rods, plate, rod

from plate_fem.elements.mesh import mesh_lines
from plate_fem.modes import plate_modes
from plate_fem.solution import model
from plate_fem.solution.model import mirror_axes

LOADS_M = [[0.1, 0.03], [-0.04, 0.12]]
PLATES = {
    "rods": {"rods": four_rods(), "max_frequency_Hz": 3e3},
    "kirchhoff": {"rods": four_rods(), "max_frequency_Hz": 2e3, "theory": "kirchhoff"},
    "clamped": {"edges": "clamped", "max_frequency_Hz": 4e3, "size_m": [0.5, 0.3]},
    "simply supported": {"edges": "simply_supported", "max_frequency_Hz": 4e3},
    "one axis": {"rods": [rod(0.1, 0.08), rod(0.1, -0.08)], "max_frequency_Hz": 2e3},
}


@pytest.mark.parametrize("changes", PLATES.values(), ids=PLATES)
def test_modes_are_those_without_mirrors(changes, monkeypatch):
    """Frequencies, and what does not depend on how equal frequencies share their shapes: mobility, rod forces."""
    table = plate(**changes)
    found = plate_modes(table, None, LOADS_M)
    monkeypatch.setattr(model, "mirror_axes", lambda *_: [])
    expected = plate_modes(table, None, LOADS_M)
    scale = expected.frequency_Hz[-1]
    assert found.frequency_Hz == pytest.approx(expected.frequency_Hz, rel=1e-7, abs=1e-7 * scale)
    points = np.random.default_rng(4).uniform(-0.14, 0.14, (30, 2))
    kept = len(expected.frequency_Hz) - expected.n_residual
    shape, wanted = (modes.shape_at(points)[:, :kept] for modes in (found, expected))
    assert shape @ shape.T == pytest.approx(wanted @ wanted.T, abs=1e-6 * (wanted @ wanted.T).max())
    if len(table.rods):
        force, wanted_force = (modes.rod_force[:, :kept] @ s.T for modes, s in ((found, shape), (expected, wanted)))
        assert force == pytest.approx(wanted_force, abs=1e-6 * abs(wanted_force).max())


@pytest.mark.parametrize("changes, axes", [
    ({"rods": four_rods()}, [0, 1]), ({}, [0, 1]), (PLATES["one axis"], [1]),
    ({"rods": [rod(0.1, 0.08), rod(0.1, -0.08, length_m=0.2)]}, []),
    ({"rods": [rod(0.1, 0.0)]}, [1]),
    ({"rods": [rod(0.1, 0.08), rod(0.1, -0.08 + 1e-6)]}, []),
])  # fmt: skip
def test_only_true_mirrors_are_used(changes, axes):
    table = plate(**{"max_frequency_Hz": 2e3, **changes})
    assert mirror_axes(table, mesh_lines(table)) == axes
