"""Peak forces by the paper's theory of four contact states (Section II, Figures 9 and 10)."""

from functools import cached_property

import numpy as np

from analysis import Sweep
from analysis.theory.contact_states import (
    STATES,
    Setup,
    State,
    beam_compliance,
    materials_in_order,
    peak_force_N,
    setup_of,
    total_force_N,
)
from analysis.theory.real_plate import static_compliance_m_N
from report.response.results import PlateResults


class TheoryResults:
    """Peak forces by theory, with the values of the sweep's first scene."""

    def __init__(self, sweep: Sweep, plate: PlateResults):
        self._sweep = sweep
        self._plate = plate

    @cached_property
    def setup(self) -> Setup:
        """Places, materials and supports of the first run. Raises RecordError if its scene does not hold them."""
        return setup_of(self._sweep.runs[0])

    def beam_compliance_m_N(self, x_m: np.ndarray) -> np.ndarray:
        """Return the compliance of the paper's beam at distances from the plate's centre along the axis A-B."""
        s = self.setup
        return beam_compliance(np.asarray(x_m) + s.support_length_m / 2, s.support_length_m, s.support_width_m,
                               s.thickness_m, s.plate)  # fmt: skip

    def single_peaks_N(self, x_m: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
        """Return the peak force of one sphere at each x_m (Figure 9): {material: {state: shape of x_m}}."""
        s, compliance = self.setup, self.beam_compliance_m_N(x_m)
        return {name: {key: np.array([peak_force_N(
            state, rock, radius_m=s.radius_m, speed_m_s=s.speed_m_s, plate=s.plate, restitution=s.restitution[name],
            compliance_m_N=one) for one in compliance]) for key, state in STATES.items()}
            for name, rock in s.rocks.items()}

    @cached_property
    def gangue_counts(self) -> np.ndarray:
        """Numbers of gangue spheres, from none to all, shape (stones + 1,)."""
        return np.arange(len(self.setup.places_m) + 1)

    def _totals_N(self, compliance_m_N: np.ndarray) -> dict[str, np.ndarray]:
        """Return the total force in each state (Figure 10) for each of `gangue_counts`, in the scene's order.

        compliance_m_N: of the plate at each place, shape (stones,).
        """
        s = self.setup

        def total_N(state: State, gangue_count: int) -> float:
            names = materials_in_order(gangue_count, s.gangue_order)
            return total_force_N(state, [s.rocks[name] for name in names], compliance_m_N,
                                 [s.restitution[name] for name in names],
                                 radius_m=s.radius_m, speed_m_s=s.speed_m_s, plate=s.plate)  # fmt: skip

        return {key: np.array([total_N(state, count) for count in self.gangue_counts]) for key, state in STATES.items()}

    @cached_property
    def beam_totals_N(self) -> dict[str, np.ndarray]:
        """Total force in each state on the paper's beam, shape (stones + 1,) each."""
        return self._totals_N(self.beam_compliance_m_N(self.setup.places_m[:, 0]))

    @cached_property
    def real_plate_totals_N(self) -> dict[str, np.ndarray]:
        """The same with the static compliance of the real plate. Raises RecordError if the plate is rigid or free."""
        return self._totals_N(static_compliance_m_N(self._plate.modes[0], self.setup.places_m))
