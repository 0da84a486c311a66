"""Normal contact of an elastic, perfectly plastic sphere and plate (Thornton 1997, J. Appl. Mech. 64:383).

Hertz until the peak pressure reaches the contact yield pressure p_y; from there on the pressure is cut off at
p_y, so that the force grows linearly with slope pi p_y R; unloading follows Hertz with the larger radius
R_p of the flattened contact, and so does loading again up to the largest force reached.
First yield below the surface gives p_y = 1.6 yield stresses; a fully plastic contact tends to 2.8.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class PlasticContact:
    """radius_m: R of the sphere; modulus_Pa: E*; yield_pressure_Pa: p_y of the softer body."""

    radius_m: float
    modulus_Pa: float
    yield_pressure_Pa: float

    @property
    def yield_deformation_m(self):
        """d_y = (pi p_y / 2 E*)^2 R, where the peak pressure of Hertz's contact is p_y."""
        return (math.pi * self.yield_pressure_Pa / (2 * self.modulus_Pa)) ** 2 * self.radius_m

    @property
    def yield_force_N(self):
        return self._hertz(self.radius_m, self.yield_deformation_m)

    def loading_N(self, deformation_m):
        """Force of first loading."""
        over = deformation_m - self.yield_deformation_m
        if over <= 0:
            return self._hertz(self.radius_m, deformation_m)
        return self.yield_force_N + math.pi * self.yield_pressure_Pa * self.radius_m * over

    def unloading_N(self, deformation_m, largest_m):
        """Force at a deformation no larger than the largest one reached so far."""
        radius, permanent = self._flattened(largest_m)
        return self._hertz(radius, deformation_m - permanent)

    def permanent_m(self, largest_m):
        """Deformation that is left after unloading from `largest_m`."""
        return self._flattened(largest_m)[1]

    def dissipated_J(self, largest_m):
        """Energy lost in one loading to `largest_m` and unloading."""
        d_y, over = self.yield_deformation_m, largest_m - self.yield_deformation_m
        if over <= 0:
            return 0.0
        loaded = 0.4 * self.yield_force_N * d_y + (self.yield_force_N + self.loading_N(largest_m)) / 2 * over
        returned = 0.4 * self.loading_N(largest_m) * (largest_m - self.permanent_m(largest_m))
        return loaded - returned

    def restitution(self, mass_kg, speed_m_s):
        """Rebound speed over impact speed for a mass on a plate that does not move (from the energies)."""
        kinetic = mass_kg * speed_m_s**2 / 2
        return math.sqrt(max(0.0, 1 - self.dissipated_J(self._largest(kinetic)) / kinetic))

    def _largest(self, kinetic_J):
        """Largest deformation: the work of loading equals the kinetic energy."""
        f_y, d_y = self.yield_force_N, self.yield_deformation_m
        left = kinetic_J - 0.4 * f_y * d_y
        if left <= 0:
            return (kinetic_J / (8 / 15 * self.modulus_Pa * math.sqrt(self.radius_m))) ** 0.4
        slope = math.pi * self.yield_pressure_Pa * self.radius_m
        return d_y + (math.sqrt(f_y**2 + 2 * slope * left) - f_y) / slope

    def _flattened(self, largest_m):
        """(R_p, permanent deformation) after loading to largest_m."""
        if largest_m <= self.yield_deformation_m:
            return self.radius_m, 0.0
        force = self.loading_N(largest_m)
        equivalent = (2 * force + self.yield_force_N) / (2 * math.pi * self.yield_pressure_Pa)
        radius = 4 * self.modulus_Pa / (3 * force) * equivalent**1.5
        return radius, largest_m - (0.75 * force / (self.modulus_Pa * math.sqrt(radius))) ** (2 / 3)

    def _hertz(self, radius, deformation_m):
        return 4 / 3 * self.modulus_Pa * math.sqrt(radius) * max(deformation_m, 0.0) ** 1.5
