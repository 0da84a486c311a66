"""When pictures are taken: evenly over the run, and densely while something pushes on the plate in an impact."""

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from common.scene.scene import Scene
from dem.deck.time_step import TimeStep, stone_contact_time_s
from dem.stones.assembly import Assembly

IMPACT_INTERVAL_s = 2e-5
IMPACT_CONTACT_TIMES = 2.0  # of a Hertz sphere like the stone; a contact of bonded sub-spheres lasts 1.7 of them
IMPACT_PICTURES = 100       # at most, of one impact
ALL_IMPACT_PICTURES = 200   # at most, of all impacts together


@dataclass(frozen=True)
class PictureSchedule:
    """DEM steps of the pictures: every `every` steps; and those of `in_impact`, which the engine leaves out while
    nothing pushes on the plate. `impacts` has the first and the last step of each impact, `impact_every` the steps in
    between."""

    every: int
    impact_every: int
    impacts: tuple[tuple[int, int], ...]

    @cached_property
    def in_impact(self) -> list[int]:
        """Ascending, without step 0."""
        return [step for first, last in self.impacts for step in range(first, last + 1, self.impact_every)]

    def possible(self, dem_steps: range) -> list[int]:
        """Those of consecutive rows at `dem_steps` at which there may be a picture."""
        first, last = dem_steps[0], dem_steps[-1]
        even = range(-(-first // self.every) * self.every, last + 1, self.every)
        dense = self.in_impact[bisect_left(self.in_impact, first):bisect_right(self.in_impact, last)]
        return sorted({*even, *dense}) if even or dense else []


def picture_schedule(scene: Scene, assembly: Assembly, step: TimeStep) -> PictureSchedule | None:
    """The schedule of a scene, None if it wants no pictures.

    An impact begins when the lowest point of a stone reaches the plate at rest, and lasts IMPACT_CONTACT_TIMES. Those
    of stones that arrive together are one; a stream has none. All pictures lie on rows of the fast stream, so that the
    plate is known.
    """
    if scene.time.view_interval_s is None:
        return None
    # An interval longer than the run, which LIGGGHTS might not be able to count, is one sample more than the run: a
    # picture at its start alone.
    samples = min(scene.time.view_interval_s / scene.time.sample_interval_s, step.steps // step.sample_steps + 1)
    every = step.sample_steps * max(1, round(samples))
    if scene.stones.is_stream:
        return PictureSchedule(every, 0, ())
    rows = min(IMPACT_INTERVAL_s / (step.fast_steps * step.dt_s), step.steps // step.fast_steps + 1)
    impact_every = step.fast_steps * max(1, round(rows))
    arrivals = arrival_s(assembly) / step.dt_s
    lasts = IMPACT_CONTACT_TIMES * stone_contact_time_s(assembly) / (impact_every * step.dt_s)
    pictures = min(math.ceil(lasts), IMPACT_PICTURES)
    return PictureSchedule(every, impact_every, _impacts(arrivals, impact_every, pictures, step.steps))


def arrival_s(assembly: Assembly) -> np.ndarray:
    """Time at which the lowest point of each stone reaches z = 0 in free fall, (stones,); infinite for one that does
    not fall."""
    lowest = np.full(len(assembly.sizes), np.inf)
    np.minimum.at(lowest, assembly.agglomerate, assembly.center_m[:, 2] - assembly.radius_m)
    speed = np.array([-entry.velocity_m_s[2] for entry in assembly.entries])
    entry_s = np.array([entry.entry_s for entry in assembly.entries])
    gravity = -assembly.gravity_m_s2[2]
    with np.errstate(divide="ignore"):
        return entry_s + 2 * lowest / (speed + np.sqrt(speed**2 + 2 * gravity * lowest))


def _impacts(arrivals: np.ndarray, every: int, pictures: int, steps: int) -> tuple[tuple[int, int], ...]:
    """First and last steps, multiples of `every`, of the impacts of stones that arrive at the steps `arrivals`, with
    so many pictures each; those that overlap are one, and the last ones give way where all would have too many."""
    impacts: list[tuple[int, int]] = []
    left = ALL_IMPACT_PICTURES
    for arrival in np.sort(arrivals[arrivals < steps]):
        first = max(1, math.ceil(arrival / every))
        last = min(first + pictures - 1, steps // every)
        if impacts and first <= impacts[-1][1] + 1:
            first = impacts.pop()[0]
        impacts.append((first, last))
    kept = []
    for first, last in impacts:
        last = min(last, first + left - 1)
        if first <= last:
            kept.append((first * every, last * every))
            left -= last - first + 1
    return tuple(kept)
