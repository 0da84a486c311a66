"""How quantities of stones are spread: one value, or a law with bounds, and the `[scatter]` table of a scene."""

from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from common.tables import Positive, Refused, Table, about

POINTS = 2001  # of a distribution function that is inverted
CUT_OFF = 3.0  # standard deviations of a logarithm
LEAST_RESTITUTION = 0.051  # LIGGGHTS refuses 0.05 and less
FACTORS = ("radius_factor", "density_factor", "youngs_modulus_factor", "strength_factor", "speed_factor")
OF_DRAWN = ("radius_factor", "speed_factor", "place_m", "arrival_s")  # what drawn stones have in their own table


class Distribution(Table):
    """One of the laws; a pair alone is even within the two, a number alone one value."""

    within: Annotated[tuple[float, float] | None, about("least and most; alone: even, by number")] = None
    rosin_rammler_m: Annotated[Positive | None, about(
        "sizes by mass, cut off: exp(-(d/this)^exponent) of the mass is larger than d")] = None
    exponent: Annotated[Positive | None, about("goes with it; the larger, the more alike are the sizes")] = None
    lognormal_cv: Annotated[Annotated[float, Field(ge=1e-6, le=0.5)] | None, about(
        "a factor: coefficient of variation of a lognormal law of mean 1, cut off at three standard deviations")] = None

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        by_mass = self.exponent is not None
        if by_mass != (self.rosin_rammler_m is not None):
            raise Refused("exponent", self.exponent, "must be given with rosin_rammler_m, and only with it")
        if (self.within is None) == (self.lognormal_cv is None) or (by_mass and self.within is None):
            raise Refused("within", self.within, "either this or lognormal_cv must be given")
        if self.within is not None and not self.within[0] <= self.within[1]:
            raise Refused("within", self.within, "must ascend")
        if self.within is not None and by_mass and not 0 < self.within[0] < self.within[1]:
            raise Refused("within", self.within, "must ascend, from above 0")
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """No value is smaller or larger."""
        if self.within is not None:
            return self.within
        median, sigma = self._lognormal
        return median * float(np.exp(-CUT_OFF * sigma)), median * float(np.exp(CUT_OFF * sigma))

    @property
    def is_even(self) -> bool:
        """Are all values between the bounds equally likely?"""
        return self.within is not None and self.exponent is None

    @property
    def _lognormal(self) -> tuple[float, float]:
        """Median, and standard deviation of the logarithm, of the lognormal law of mean 1."""
        assert self.lognormal_cv is not None
        sigma = float(np.sqrt(np.log1p(self.lognormal_cv**2)))
        return float(np.exp(-sigma**2 / 2)), sigma

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """(count,) values."""
        share = rng.uniform(size=count)
        least, most = self.bounds
        if self.lognormal_cv is not None:
            median, sigma = self._lognormal
            log = np.linspace(np.log(least), np.log(most), POINTS)
            return np.exp(_inverse(log, np.exp(-((log - np.log(median)) / sigma) ** 2 / 2), share))
        if self.rosin_rammler_m is not None and self.exponent is not None:
            log = np.linspace(np.log(least), np.log(most), POINTS)
            x = (np.exp(log) / self.rosin_rammler_m) ** self.exponent
            # By mass x exp(-x) over ln d; by number, that over the mass of a stone, d^3.
            return np.exp(_inverse(log, x * np.exp(-x - 3 * (log - log[0])), share))
        return least + (most - least) * share


def _inverse(x: np.ndarray, density: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Where the distribution function of a density over x, by the trapezoidal rule, has the values `share`."""
    grown = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    return np.interp(share * grown[-1], grown, x)


def one_value(value: float) -> Distribution:
    return Distribution(within=(value, value))


def _from_few(value: Any) -> Any:
    """A number stands for a table with one value, a pair for one of even values."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return {"within": (float(value), float(value))}
    if isinstance(value, (list, tuple)):
        return {"within": value}
    if not isinstance(value, (dict, Distribution)):
        raise ValueError("must be a number, a pair, or a table with rosin_rammler_m or lognormal_cv")
    return value


Spread = Annotated[Distribution, BeforeValidator(_from_few)]


def refuse_outside(key: str, spread: Distribution | None, least: float, most: float, what: str) -> None:
    """Raises Refused where a distribution may give values outside its key's bounds."""
    if spread is not None and not (least <= spread.bounds[0] and spread.bounds[1] <= most):
        raise Refused(key, spread.bounds[0] if len(set(spread.bounds)) == 1 else spread.bounds, what)


class ScatterTable(Table):
    """What each stone has of its own. A key is a number or a distribution; the mixing ratio changes nothing in it."""

    seed: Annotated[Annotated[int, Field(ge=0, lt=2**63)] | None, about(
        "seed of what is drawn; absent: stones.seed")] = None
    radius_factor: Annotated[Spread | None, about("factor on a stone's radius")] = None
    density_factor: Annotated[Spread | None, about("factor on its density")] = None
    youngs_modulus_factor: Annotated[Spread | None, about("factor on the Young's modulus of stone and bonds")] = None
    strength_factor: Annotated[Spread | None, about(
        "factor on the strengths of its bonds; their fracture energy has its square")] = None
    restitution: Annotated[Spread | None, about(
        "coefficient of restitution on the plate; on other stones: docs/stones.md")] = None
    speed_factor: Annotated[Spread | None, about("factor on its impact velocity")] = None
    place_m: Annotated[Positive | None, about(
        "radius of the disc about its place in which a stone is drawn, on the plate and free of others")] = None
    arrival_s: Annotated[Spread | None, about("what is added to its arrival")] = None

    @model_validator(mode="after")
    def _within_bounds(self) -> Self:
        for key in FACTORS:
            refuse_outside(key, getattr(self, key), 0.05, 20.0, "must be from 0.05 to 20")
        refuse_outside("restitution", self.restitution, LEAST_RESTITUTION, 1.0,
                       f"must be from {LEAST_RESTITUTION:g} to 1")
        refuse_outside("arrival_s", self.arrival_s, 0.0, 1e6, "must be from 0 to 1e6")
        return self

    @property
    def drawn(self) -> list[str]:
        """Names of the keys that are given, less the seed."""
        return [key for key in type(self).model_fields if key != "seed" and getattr(self, key) is not None]
