"""Likelihood of the materials of stones, by Laplace's method.

The numbers u and a of stones (recognition.physics.force_law) are sought that explain a record best, by Gauss and
Newton's steps. About them, signals are taken to be linear in the numbers: the likelihood of the record is normal in
them, and its integral over the numbers of stones of any materials is known (MacKay, Information Theory, Inference, and
Learning Algorithms, 2003, chapter 27). That is done first about the numbers of stones of which nobody asks which are
gangue, for all arrangements at once, and then, for those that are likely, about their own: the numbers of stones that
are nearly clones are known so well beforehand that they lie far from those of any stone where the plate's model errs.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from recognition.estimation.arrays import Floats, Integers
from recognition.physics.force_law import ForceLaw, of_either

STEPS, SETTLED, LARGEST_STEP = 20, 1e-2, 0.7  # how many at most, steps that end them, and the largest of any number
PATH = ["einsum_path", (0, 1), (0, 1)]  # of three factors; to seek it anew takes longer than the products
LIKELY = 100  # arrangements, the best, about whose own numbers signals are linear


@dataclass(frozen=True)
class NearRecord:
    """A record and the responses to the forms of the force on each place, in units of what no number explains: power:
    square of the record; along (stones, k), gram (stones, k, stones, k): products of the responses with the record and
    with each other; numbers (stones, k): which explain it best; log_determinant: of the rest's covariance."""

    power: float
    along: Floats
    gram: Floats
    numbers: Floats
    log_determinant: float

    @classmethod
    def of(cls, record: Floats, response: Floats, law: ForceLaw, log_determinant: float) -> Self:
        """Of a record (d,) and the responses (d, stones, k)."""
        of_one, covariance = of_either(law.mean[:, 0], law.covariance)
        mean = np.tile(of_one, (response.shape[1], 1))
        found = cls(float(record @ record), np.tensordot(record, response, 1),
                    np.tensordot(response, response, (0, 0)), mean, log_determinant)
        precision = np.broadcast_to(np.linalg.inv(covariance), (len(mean), *covariance.shape))
        return replace(found, numbers=found._best(mean[None], precision[None])[0])

    def _about(self, numbers: Floats) -> tuple[Floats, Floats, Floats]:
        """About numbers (m, stones, k): chi-square (m,) of the record, and half of its derivatives, the first (m,
        stones k) with a minus, the second (m, stones k, stones k)."""
        m, stones, k = numbers.shape
        by_numbers = np.zeros((m, stones, k, k))  # derivatives of the weights e^u (1, a ...)
        by_numbers[..., 0] = np.concatenate([np.ones((m, stones, 1)), numbers[..., 1:]], axis=2)
        by_numbers[..., 1:, 1:] = np.eye(k - 1)
        by_numbers *= np.exp(numbers[..., :1, None])
        weights = by_numbers[..., 0]
        left = self.along - np.tensordot(weights, self.gram, 2)
        chi_square = self.power - (weights * (self.along + left)).sum(axis=(1, 2))
        pull = np.einsum("mipa,mip->mia", by_numbers, left).reshape(m, -1)
        curvature = np.einsum("mipa,ipjq,mjqb->miajb", by_numbers, self.gram, by_numbers, optimize=PATH)
        return chi_square, pull, curvature.reshape(m, stones * k, -1)

    def _best(self, mean: Floats, precision: Floats) -> Floats:
        """Numbers (m, stones, k) that explain the record best where those of stones have a mean (m, stones, k) and the
        inverse of a covariance (m, stones, k, k)."""
        numbers = np.tile(self.numbers, (len(mean), 1, 1))
        for _ in range(STEPS):
            _, pull, curvature = self._about(numbers)
            back = np.matmul(precision, (numbers - mean)[..., None]).reshape(pull.shape)
            step = np.linalg.solve(_with(curvature, precision), (pull - back)[..., None]).reshape(numbers.shape)
            numbers = numbers + np.clip(step, -LARGEST_STEP, LARGEST_STEP)
            if abs(step).max() < SETTLED:
                break
        return numbers

    def integrals(self, means: Floats, covariance: Floats, which: Integers) -> tuple[Floats, Floats]:
        """Of each arrangement `which` (m, stones) of two materials, all of them in order, whose numbers have one of the
        means (v, 2, k) and a covariance (2, k, k): least chi-square (v, m) of record and numbers together, and
        logarithm (v, m) of the ratio of the volumes after and before, squared. Minus twice the log likelihood is their
        sum with log_determinant."""
        chi_square, after = self._about_any(means, covariance)
        before = np.linalg.slogdet(covariance)[1][which].sum(axis=1)
        volume = np.tile(after + before, (len(means), 1))
        v, m = np.unravel_index(np.argsort(chi_square + volume, axis=None)[:LIKELY], chi_square.shape)
        mean, precision = means[v[:, None], which[m]], np.asarray(np.linalg.inv(covariance), float)[which[m]]
        best = self._best(mean, precision)
        at, _, curvature = self._about(best)
        chi_square[v, m] = at + np.einsum("mik,mikl,mil->m", best - mean, precision, best - mean)
        volume[v, m] = np.linalg.slogdet(_with(curvature, precision))[1] + before[m]
        return chi_square, volume

    def _about_any(self, means: Floats, covariance: Floats) -> tuple[Floats, Floats]:
        """Where signals are linear about the numbers of any stone: least chi-square (v, m) as of `integrals`, and the
        log determinant (m,) of the curvature of record and numbers together. The numbers of one stone after another
        are eliminated, of either material: what is left of the others is the Schur complement (Horn, Johnson, Matrix
        Analysis, 2013), which arrangements that begin alike share."""
        speeds, (stones, k) = len(means), self.numbers.shape
        at, pull, curvature = self._about(self.numbers[None])
        off, precision = self.numbers - means[:, :, None], np.asarray(np.linalg.inv(covariance), float)
        back = np.matmul(off, precision)  # (v, 2, stones, k)
        far, back = (off * back).sum(axis=3).T, back.transpose(2, 1, 3, 0)
        least, volume, slope = np.tile(at, (1, speeds)), np.zeros(1), np.tile(pull[:, :, None], speeds)
        for stone in range(stones):
            begun, others = 2 << stone, k * (stones - 1 - stone)
            own, beside = curvature[:, None, :k, :k] + precision, np.repeat(curvature[:, None, :k, k:], 2, axis=1)
            of_own = slope[:, None, :k] - back[stone]
            solved = np.linalg.solve(own, np.concatenate([beside, of_own], axis=3))
            least = least[:, None] + far[stone] - (of_own * solved[..., others:]).sum(axis=2)
            moved = np.matmul(beside.swapaxes(2, 3), solved)
            least, volume = least.reshape(begun, -1), (volume[:, None] + np.linalg.slogdet(own)[1]).ravel()
            curvature = (curvature[:, None, k:, k:] - moved[..., :others]).reshape(begun, others, others)
            slope = (slope[:, None, k:] - moved[..., others:]).reshape(begun, others, speeds)
        return least.T, volume


def _with(curvature: Floats, precision: Floats) -> Floats:
    """Curvature (m, stones k, stones k), or one for all, with the precision (m, stones, k, k) of each stone."""
    m, stones, k = precision.shape[:3]
    curved = np.tile(curvature, (m // len(curvature), 1, 1)).reshape(m, stones, k, stones, k)
    own = np.arange(stones)
    curved[:, own, :, own] += precision.swapaxes(0, 1)
    return curved.reshape(m, stones * k, -1)
