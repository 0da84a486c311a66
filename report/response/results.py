"""Modes and stress of the plate, driven again by the recorded forces (Figures 20 and 21)."""

from functools import cached_property
from typing import Any

import numpy as np

from analysis import Run, Sweep
from analysis.theory.contact_states import setup_of
from analysis.theory.real_plate import (
    amplitude_at_peak,
    contact_stress_map_Pa,
    hertz_contacts,
    modes_of,
    nodal_at,
    particle_forces_N,
)
from plate_fem.stress import surface_stress, von_mises

#: Stress counts as high above this share of the highest bending stress in any run.
HIGH_STRESS_SHARE = 0.8

#: Distance of the points below the stones at which the bending stress is taken.
POINT_DISTANCE_M = 0.0025


class PlateResults:
    """Stress of the plate in each run, at the instant of the largest total force unless said otherwise.

    Raises RecordError for a rigid plate, which has no modes, and for runs that kept no fast stream.
    """

    def __init__(self, sweep: Sweep):
        self._runs = sweep.runs

    @cached_property
    def modes(self) -> list[Any]:
        """Modes (`plate_fem.modes.PlateModes`) of each run's plate.

        They may differ from run to run, since their number may follow from the duration of the contact.
        """
        found: dict[str, Any] = {}
        for run in self._runs:
            if (key := _plate_key(run)) not in found:
                found[key] = modes_of(run)
        return [found[_plate_key(run)] for run in self._runs]

    @cached_property
    def amplitudes(self) -> list[np.ndarray]:
        """Modal amplitudes of each run, shape (modes,) each."""
        return [amplitude_at_peak(modes, run) for modes, run in zip(self.modes, self._runs, strict=True)]

    @cached_property
    def _nodal_stress_Pa(self) -> list[np.ndarray]:
        """Von Mises stress of bending at the top surface, at the nodes of each run's modes."""
        pairs = zip(self.modes, self.amplitudes, strict=True)
        return [von_mises(surface_stress(modes, amplitude)) for modes, amplitude in pairs]

    def bending_stress_at_Pa(self, points_m: np.ndarray) -> np.ndarray:
        """Return the von Mises stress of bending at points (k, 2) of the top surface, shape (runs, k).

        Shares of an area are counted over such points and not over nodes, so that they do not depend on the mesh.
        """
        pairs = zip(self.modes, self._nodal_stress_Pa, strict=True)
        return np.stack([nodal_at(modes, field, points_m) for modes, field in pairs])

    def contact_stress_Pa(self, number: int, offset_m: np.ndarray) -> list[np.ndarray]:
        """Return von Mises stress maps about one stone's place, Hertz' field of each contact included, one a run.

        number: of the stone, from 1. offset_m: shape (k,), along x and along y. Each map has the shape (k, k).
        """
        maps = []
        for run, modes, amplitude in zip(self._runs, self.modes, self.amplitudes, strict=True):
            force_N = particle_forces_N(run)[1]
            contacts = hertz_contacts(run, force_N[np.argmax(force_N.sum(axis=1))])
            poisson_ratio = setup_of(self._runs[0]).plate.poisson_ratio
            maps.append(contact_stress_map_Pa(modes, amplitude, contacts, number, poisson_ratio, offset_m))
        return maps

    @cached_property
    def contact_pressure_Pa(self) -> np.ndarray:
        """Largest Hertz pressure of the run under each stone, taken as one whole sphere, shape (runs, stones)."""
        rows = [hertz_contacts(run, particle_forces_N(run)[1].max(axis=0)) for run in self._runs]
        return np.array([[contact.peak_pressure_Pa for contact in row] for row in rows])

    @cached_property
    def _stress_below_stones_Pa(self) -> np.ndarray:
        """Bending stress at points on discs of the stones' radius about their places, shape (runs, points)."""
        s = setup_of(self._runs[0])
        offsets = np.arange(-s.radius_m, s.radius_m + POINT_DISTANCE_M / 2, POINT_DISTANCE_M)
        disc = np.array([(x, y) for x in offsets for y in offsets if np.hypot(x, y) <= s.radius_m])
        return self.bending_stress_at_Pa((s.places_m[:, None] + disc).reshape(-1, 2))

    @property
    def mean_stress_below_stones_Pa(self) -> np.ndarray:
        """Mean bending stress below the stones, shape (runs,)."""
        return self._stress_below_stones_Pa.mean(axis=1)

    @property
    def high_stress_share(self) -> np.ndarray:
        """Share of the area below the stones with a high bending stress, shape (runs,), 0..1."""
        stress_Pa = self._stress_below_stones_Pa
        return (stress_Pa > HIGH_STRESS_SHARE * stress_Pa.max()).mean(axis=1)


def _plate_key(run: Run) -> str:
    return repr((run.scene.plate, run.summary.n_modes))
