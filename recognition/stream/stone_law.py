"""What the stones of a record are like: the law of their forces, learnt from the record and from stones one knows.

Of a stone one hears x = (log s, b, log J), the duration, form and impulse of its force, with an error. Whole stones of
coal scatter about a centre, those of gangue about another; how far these are apart follows from Hertz' law, densities
and stiffnesses. Centres, what is between them, and the scatter of the stones vary along known directions:

    size          s ~ R, J ~ R^3                      speed      s ~ v^(-1/5), J ~ v
    restitution   s ~ (1 + e)^(-0.85), J ~ 1 + e      stiffness  s ~ E^(-2/5)
    density       s ~ rho^(2/5), J ~ rho

How far they vary is unknown, and so are the shares of gangue, of stones of either material that break, which have
another form, of stones that bounced or met in the air, and how slow these are, and of what is no stone: a second touch,
a fragment, a knock; and by how much the errors are larger than the fit says. The simulated law of forces is the prior
of all that. Of known stones about one is of the other material. Known stones that were dropped may have had another
speed and size than those of the record.

Where the record fits several laws, the draws hold all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recognition.estimation.arrays import Floats
from recognition.estimation.posterior import drawn
from recognition.innovations.prior import StonePrior

#: In (log s, b, log J): size, speed, restitution, stiffness, density. The form of small stones is another.
DIRECTIONS = np.array([[1.0, -0.75, 3.0], [-0.2, 0.0, 1.0], [-0.85, 0.0, 1.0], [1.0, 0.0, 0.0], [0.4, 0.0, 1.0]])
#: Standard deviations of the logarithms along them: of the centre about the law and the limits that are told, and of
#: what tells gangue from coal about the law; of b, of both and between them.
CENTRE_SD, CENTRE_FORM_SD = np.array([0.1, 0.1, 0.12, 0.05, 0.05]), 0.3
APART_SD, APART_FORM_SD = np.array([0.08, 0.12, 0.05, 0.03, 0.1]), 0.2
DROPPED_SD = np.array([0.05, 0.1])  # of known stones' size and speed, by those of the record
#: Median, standard deviation of the logarithm, and largest logarithm, of the scatter along size, speed, restitution and
#: stiffness.
SCATTER, SCATTER_SD, WIDEST = np.array([0.05, 0.05, 0.03, 0.03]), 1.0, 1.0
BREAKS_SD, OTHER, OTHER_SD = 1.5, -3.5, 1.0  # of logits
HARDER_SD = 0.75  # of the logit of coal that breaks less that of gangue: of a weaker seam both break more
LUMPS, LUMP_SD = 0.03, 0.8  # share, and deviation of the logarithm of size
#: Stones that come down slower, since they bounced or struck another in the air: time within which two meet, so that
#: the odds grow as the rate of stones, 10 to 400 a second; deviation of their logit, FEWER times as large below: far
#: apart none meet. Of the logarithm of their speed, mean and logarithm of the deviation, with deviations of both:
#: restitutions from 0.5 to 0.9 leave -0.37 and log 0.17, stones that meet in the engine -0.5 and log 0.35.
MEET_S, SLOWED_SD, FEWER = 3e-3, 0.7, 3.0
SLOWER, SLOWER_SD = np.array([-0.47, np.log(0.28)]), np.array([0.12, 0.3])
USUAL_1_s, FASTEST_1_s = 50.0, 400.0  # rates where none is told, and beyond which none is known
#: Of how many times larger the errors are than told, the logarithm: the plate is not quite its model, most at high
#: frequencies, from which the durations and forms of small stones follow.
LARGER, LARGER_SD = 0.3, 0.4
OTHER_DENSITY = 1 / (3.0 * 12.0 * 6.0)  # of what is no such stone: log s, b and log J are anything
#: Of known stones to be of the other material: one of all of them is, but of few at most such a share. More would let
#: coal that hardly looks like it, of which some are among many, be gangue to the law, whose gangue is then too alike.
WRONG = 0.05
LEAST_APART = 0.15, 0.15  # of log J and log J - 3 log s: gangue of one size and speed pushes harder than coal
CENTRE, APART, SCATTERS, GANGUE, BROKEN = slice(0, 3), slice(3, 6), slice(6, 10), 10, slice(11, 13)
OTHERS, SLOW, ERRORS, DROPPED, HOW_SLOW, NUMBERS = 13, 14, 15, slice(16, 18), slice(18, 20), 20
TAUGHT, STARTS, DRAWN = 200, 21, 48  # stones by which the law is learnt, so many known and unknown at most; laws
AT_ONCE = 16_000  # laws times stones, which stay in the processor's cache
LEAST_ERROR = 1e-3  # of logarithms
UNKNOWN = -1
MASS = np.array([3.0, 0, 0, 0, 1])  # of its logarithm along DIRECTIONS
Integers = NDArray[np.int64]
_FORM = np.diag([0.0, 1.0, 0.0])
_BREAKS = np.linalg.inv(BREAKS_SD**2 - HARDER_SD**2 / 2 * (1 - np.eye(2)))


@dataclass(frozen=True)
class Told:
    """What is heard of stones: x (n, 3) with the covariance of its errors (n, 3, 3); known (n,): 0 coal, 1 gangue, -1
    unknown; dropped (n,): whether it is a known stone that did not fall with the others."""

    x: Floats
    error: Floats
    known: Integers
    dropped: NDArray[np.bool_]

    @classmethod
    def of(cls, triple: Floats, covariance: Floats, prior: StonePrior, known: Integers,
           dropped: NDArray[np.bool_]) -> Told:
        """From fits of log s, b and log J (n, 3) with covariances (n, 3, 3), out of which the wide prior of the fit is
        taken again."""
        wide = 0.999 * prior.precision  # where nothing is told of a number its error is some times the prior's
        posterior = np.linalg.inv(covariance)
        told = posterior - wide
        linear = (posterior @ triple[..., None])[..., 0] - wide @ prior.typical
        x = np.asarray(np.linalg.solve(told, linear[..., None])[..., 0], float)
        error = np.asarray(np.linalg.inv(told), float) + LEAST_ERROR**2 * np.eye(3)
        return cls(x, error, known, dropped)

    def some(self, count: int) -> Told:
        """At most so many known ones and so many unknown ones, evenly spread over time."""
        parts = (np.flatnonzero((self.known != UNKNOWN) == known) for known in (True, False))
        return self.only(np.concatenate([part[_spread(len(part), count)] for part in parts]))

    def only(self, chosen: Integers) -> Told:
        """Some of the stones."""
        return Told(self.x[chosen], self.error[chosen], self.known[chosen], self.dropped[chosen])

    def and_(self, more: Told) -> Told:
        """These stones and more."""
        return Told(*(np.concatenate(pair) for pair in zip(vars(self).values(), vars(more).values(), strict=True)))


def _spread(there: int, count: int) -> Integers:
    return np.arange(there) if there <= count else np.linspace(0, there - 1, count).astype(int)


@dataclass(frozen=True)
class Beliefs:
    """What is believed of the law before a record: means of centre and of what is between the materials (3,), and their
    precisions (2, 3, 3); limits (5,): variances along DIRECTIONS between what is told; shift (2, 3) of broken stones of
    coal and gangue; covariances (3, 3) of whole and broken stones about the law; median log scatter (4,); logits of the
    shares that break (2,), and of that of stones that come down slower."""

    centre: Floats
    apart: Floats
    precisions: Floats
    limits: Floats
    shift: Floats
    whole: Floats
    broken: Floats
    scatter: Floats
    breaks: Floats
    slowed: float

    @classmethod
    def of(cls, prior: StonePrior, rate_1_s: float = USUAL_1_s) -> Beliefs:
        """Of the simulated law, limits that are told, between which a scatter is likely, and a rate of stones."""
        forces, logs = prior.forces, np.log(prior.grid)
        radius, speed = (np.array(value) for value in np.exp(logs.mean(axis=0)))
        coal, gangue = (forces.mean(m, radius, speed) for m in (0, 1))
        limits = np.r_[logs.var(axis=0), 0, 0, 0]
        centre = _along(CENTRE_SD**2 + limits) + CENTRE_FORM_SD**2 * _FORM
        apart = _along(APART_SD**2) + APART_FORM_SD**2 * _FORM
        shift = np.array([forces.broken_mean(m, radius, speed) - mean + _faster(prior, m) * DIRECTIONS[1]
                          for m, mean in enumerate((coal, gangue))])
        share = np.array([forces.share_at(m, speed) for m in (0, 1)]).clip(0.02, 0.98)
        precisions = np.asarray(np.linalg.inv([centre, apart]), float)
        return cls(coal, gangue - coal, precisions, limits, shift,
                   _FORM * np.mean(forces.scatter, axis=0), forces.broken_scatter,
                   np.log(np.maximum(SCATTER, np.sqrt(limits[:4]))), np.log(share / (1 - share)),
                   float(np.log(MEET_S * np.clip(rate_1_s, 1, FASTEST_1_s))))

    def starts(self, told: Told, rng: np.random.Generator) -> Floats:
        """(STARTS, NUMBERS): laws with any share of gangue, that explain the middle of what was heard."""
        z = rng.standard_normal((STARTS, NUMBERS))
        share = np.resize([0.02, 0.15, 0.35, 0.5, 0.65, 0.85, 0.98], STARTS)
        z[:, APART] = self.apart + z[:, APART] @ np.linalg.cholesky(np.linalg.inv(self.precisions[1])).T
        z[:, CENTRE] = np.median(told.x, axis=0) - share[:, None] * z[:, APART] + 0.05 * z[:, CENTRE]
        z[:, SCATTERS] = self.scatter + 0.7 * z[:, SCATTERS]
        z[:, GANGUE] = np.log(share / (1 - share))
        z[:, BROKEN] += self.breaks
        z[:, OTHERS] += OTHER
        z[:, SLOW] = self.slowed + SLOWED_SD * z[:, SLOW]
        z[:, ERRORS] = LARGER + LARGER_SD * z[:, ERRORS]
        z[:, DROPPED] *= DROPPED_SD
        z[:, HOW_SLOW] = SLOWER + SLOWER_SD * z[:, HOW_SLOW]
        return z

    def log_prior(self, z: Floats) -> Floats:
        """(k,): of laws (k, NUMBERS), but for a constant; any share of gangue is as likely."""
        off, apart, breaks = z[:, CENTRE] - self.centre, z[:, APART] - self.apart, z[:, BROKEN] - self.breaks
        slow = (z[:, SLOW] - self.slowed) / SLOWED_SD
        total = -0.5 * (np.einsum("ki,ij,kj->k", off, self.precisions[0], off)
                        + np.einsum("ki,ij,kj->k", apart, self.precisions[1], apart)
                        + np.sum(((z[:, SCATTERS] - self.scatter) / SCATTER_SD) ** 2, axis=1)
                        + np.einsum("ki,ij,kj->k", breaks, _BREAKS, breaks)
                        + ((z[:, OTHERS] - OTHER) / OTHER_SD) ** 2 + np.maximum(slow, slow / FEWER) ** 2
                        + ((z[:, ERRORS] - LARGER) / LARGER_SD) ** 2
                        + np.sum((z[:, DROPPED] / DROPPED_SD) ** 2, axis=1)
                        + np.sum(((z[:, HOW_SLOW] - SLOWER) / SLOWER_SD) ** 2, axis=1))
        s, _, j = z[:, APART].T
        too_light = np.minimum(np.minimum(j - LEAST_APART[0], j - 3 * s - LEAST_APART[1]), 0)
        return np.asarray(total - np.logaddexp(0, z[:, GANGUE]) - np.logaddexp(0, -z[:, GANGUE]) - 1e3 * too_light**2)

    @property
    def curvature(self) -> Floats:
        """(NUMBERS, NUMBERS): about that of minus the log prior."""
        out = np.diag(np.r_[np.zeros(6), np.full(4, SCATTER_SD**-2), 0.25, np.zeros(2), OTHER_SD**-2, SLOWED_SD**-2,
                            LARGER_SD**-2, DROPPED_SD**-2, SLOWER_SD**-2])
        out[CENTRE, CENTRE], out[APART, APART] = self.precisions
        out[BROKEN, BROKEN] = _BREAKS
        return out

    def log_classes(self, z: Floats, told: Told) -> Floats:
        """(k, n, 3): log of the densities of coal, gangue and others, with their shares."""
        return np.concatenate(list(self._parts(z, told)))

    def log_densities(self, z: Floats, told: Told) -> Floats:
        """(k, n): log of their sum."""
        return np.concatenate([log_sum(part) for part in self._parts(z, told)])

    def _parts(self, z: Floats, told: Told) -> Iterator[Floats]:
        size = max(1, AT_ONCE // max(len(told.x), 1))
        return (self._log_classes(z[k:k + size], told) for k in range(0, len(z), size))

    def _log_classes(self, z: Floats, told: Told) -> Floats:
        spread = np.einsum("kd,di,dj->kij", np.exp(2 * z[:, SCATTERS].clip(max=WIDEST)), DIRECTIONS[:4], DIRECTIONS[:4])
        error = np.moveaxis(told.error, 0, -1)[:, :, None] * np.exp(2 * z[:, ERRORS, None])
        size, speed = (np.outer(d, d) for d in DIRECTIONS[:2])
        lumps, slower = LUMP_SD**2 * size, np.exp(2 * z[:, HOW_SLOW][:, 1, None, None]) * speed
        slow_mean = z[:, HOW_SLOW][:, 0, None] * DIRECTIONS[1][:, None, None]
        whole, broken, lump, slowed = (
            _root(np.moveaxis(spread + law, 0, -1)[..., None] + error)
            for law in (self.whole, self.broken, self.whole + lumps, self.whole + slower))
        moved = (z[:, DROPPED] @ DIRECTIONS[:2]).T[..., None] * told.dropped
        p, unknown, others = z[:, GANGUE, None], told.known == UNKNOWN, z[:, OTHERS, None]
        wrong = min(WRONG, 1 / max(np.sum(~unknown), 1))
        slow = np.where(told.dropped, -np.inf, z[:, SLOW, None])  # one that is dropped alone meets no other
        out = np.empty((len(z), len(told.x), 3))
        for m, sign in ((0, 1), (1, -1)):
            centre = (z[:, CENTRE] + m * z[:, APART]).T[..., None] + moved
            off, breaks = told.x.T[:, None] - centre, z[:, BROKEN][:, m, None]
            stones = np.logaddexp(normal(off, whole) - np.logaddexp(0, breaks),
                                  normal(off - self.shift[m][:, None, None], broken) - np.logaddexp(0, -breaks))
            every = np.logaddexp(stones - np.logaddexp(0, slow),
                                 normal(off - slow_mean, slowed) - np.logaddexp(0, -slow))
            every = np.logaddexp(every + np.log(1 - LUMPS), normal(off, lump) + np.log(LUMPS))
            share = np.where(unknown, -np.logaddexp(0, sign * p), np.log(np.where(told.known == m, 1 - wrong, wrong)))
            out[..., m] = every + share - np.logaddexp(0, others)
        out[..., 2] = np.log(OTHER_DENSITY) - np.logaddexp(0, -others)
        return out


@dataclass(frozen=True)
class LearntLaw:
    """Laws (DRAWN, NUMBERS) that stand for all, each as likely as the others. worth: independent draws of them."""

    beliefs: Beliefs
    laws: Floats
    worth: float

    @classmethod
    def of(cls, told: Told, prior: StonePrior, rate_1_s: float = USUAL_1_s) -> LearntLaw:
        """The law by which stones were heard, so many a second; the same for the same stones."""
        beliefs, taught, rng = Beliefs.of(prior, rate_1_s), told.some(TAUGHT), np.random.default_rng(1)

        def densities(z: Floats) -> tuple[Floats, Floats]:
            return beliefs.log_densities(z, taught), beliefs.log_prior(z)

        return cls(beliefs, *drawn(densities, beliefs.starts(taught, rng), beliefs.curvature, DRAWN, rng))

    def materials(self, told: Told) -> tuple[Floats, Floats]:
        """Of stones: the logarithm of the odds of gangue by each law with a share of gangue of one half (n, DRAWN), and
        the probability that they are none (n,)."""
        by_class = self.beliefs.log_classes(self.laws, told)
        odds = by_class[..., 1] - by_class[..., 0]
        odds -= np.where(told.known == UNKNOWN, self.laws[:, GANGUE, None], 0)
        none = np.exp(by_class[..., 2] - log_sum(by_class)).mean(axis=0)
        return odds.T, none

    def probabilities(self, told: Told, least_doubt: float) -> tuple[Floats, Floats]:
        """Of stones to be gangue, by each law (n, DRAWN), and to be none (n,)."""
        odds, none = self.materials(told)
        return doubted(odds, least_doubt), none

    def slowed(self, told: Told) -> Floats:
        """Probability (n,) of stones that they came down slower than the others."""
        fast = self.laws.copy()
        fast[:, SLOW] = -np.inf
        no_slower, any_speed = (np.logaddexp(*np.moveaxis(self.beliefs.log_classes(z, told)[..., :2], -1, 0))
                                for z in (fast, self.laws))
        share = -np.logaddexp(0, self.laws[:, SLOW, None])
        return np.asarray(1 - np.exp(share + no_slower - any_speed).clip(max=1).mean(axis=0))

    def drawn(self, number: int, material: int, count: int, told: Told) -> Told:
        """So many stones of a material by one of the laws, heard as well as those that are told; always the same."""
        z, b, rng = self.laws[number], self.beliefs, np.random.default_rng([2, number, material])
        breaks = rng.random(count) < 1 / (1 + np.exp(-z[BROKEN][material]))
        error = told.error[rng.integers(len(told.error), size=count)]
        scatter = np.where(breaks[:, None, None], b.broken, b.whole) + _along(np.r_[np.exp(2 * z[SCATTERS]), 0])
        scatter = scatter + np.exp(2 * z[ERRORS]) * error
        off = np.einsum("nij,nj->ni", np.linalg.cholesky(scatter), rng.standard_normal((count, 3)))
        centre = z[CENTRE] + material * z[APART] + breaks[:, None] * b.shift[material]
        return Told(centre + off, error, np.full(count, UNKNOWN), np.zeros(count, dtype=bool))

    def apart_as_believed(self) -> LearntLaw:
        """These laws, of which gangue is as far from coal as was believed before any stone; always the same."""
        z, b = self.laws.copy(), self.beliefs
        z[:, APART] = np.random.default_rng(5).multivariate_normal(b.apart, np.linalg.inv(b.precisions[1]), len(z))
        return replace(self, laws=z)

    def misplaced(self, told: Told) -> int:
        """How many known stones seem to be of the other material, or no stone."""
        known = np.flatnonzero(told.known != UNKNOWN)
        by_class = self.beliefs.log_classes(self.laws, told)[:, known]
        own = np.take_along_axis(by_class, told.known[known].astype(int)[None, :, None], axis=2)[..., 0]
        return int(np.sum(np.exp(own - log_sum(by_class)).mean(axis=0) < 0.5))

    @property
    def beyond(self) -> float:
        """How far the stones are from all that was told of them, in standard deviations."""
        off = self.laws[:, CENTRE].mean(axis=0) - self.beliefs.centre
        return float(np.sqrt(off @ self.beliefs.precisions[0] @ off))

    def made_of(self, told: Told, material: int) -> tuple[Floats, Floats]:
        """Deviations (n, 5) along DIRECTIONS of stones from the middle of what is told, were they of a material, and
        their covariance (n, 5, 5). What size may explain it does, since some are lumps."""
        b, off = self.beliefs, told.x - self.beliefs.centre - material * self.beliefs.apart
        v = np.diag(b.limits + CENTRE_SD**2 + np.r_[LUMP_SD**2, np.zeros(4)])
        seen = DIRECTIONS.T @ v @ DIRECTIONS + b.whole + CENTRE_FORM_SD**2 * _FORM + told.error
        gain = np.linalg.solve(seen, DIRECTIONS.T @ v).swapaxes(1, 2)
        return np.einsum("nij,nj->ni", gain, off), v - gain @ DIRECTIONS.T @ v


def _faster(prior: StonePrior, material: int) -> float:
    """Logarithm of the speed of stones that break, in the mean, less that of all."""
    speed = prior.grid[:, 1]
    share = prior.forces.share_at(material, speed).clip(1e-3)
    return float(np.average(np.log(speed), weights=share) - np.log(speed).mean())


def doubted(log_odds: Floats, least_doubt: float) -> Floats:
    """Probabilities of any log odds."""
    return np.asarray(least_doubt + (1 - 2 * least_doubt) / (1 + np.exp(-np.clip(log_odds, -50, 50))))


def log_sum(values: Floats) -> Floats:
    """Logarithm of the sum of exponentials over the last axis, of three."""
    return np.logaddexp(np.logaddexp(values[..., 0], values[..., 1]), values[..., 2])


def _along(variances: Floats) -> Floats:
    """(3, 3): covariance of independent variances along DIRECTIONS."""
    return np.asarray(np.einsum("d,di,dj->ij", variances, DIRECTIONS, DIRECTIONS))


def _root(c: Floats) -> tuple[Floats, ...]:
    """Lower Cholesky factor l00, l10, l11, l20, l21, l22 of matrices (3, 3, ...)."""
    l00 = np.sqrt(c[0, 0])
    l10, l20 = c[1, 0] / l00, c[2, 0] / l00
    l11 = np.sqrt(c[1, 1] - l10**2)
    l21 = (c[2, 1] - l20 * l10) / l11
    return l00, l10, l11, l20, l21, np.sqrt(c[2, 2] - l20**2 - l21**2)


def normal(off: Floats, root: tuple[Floats, ...]) -> Floats:
    """Log density of a normal distribution at deviations (3, ...) from its centre."""
    l00, l10, l11, l20, l21, l22 = root
    a = off[0] / l00
    b = (off[1] - l10 * a) / l11
    c = (off[2] - l20 * a - l21 * b) / l22
    return np.asarray(-np.log(l00 * l11 * l22) - 1.5 * np.log(2 * np.pi) - (a * a + b * b + c * c) / 2)
