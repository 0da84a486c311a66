"""Where and when something fell, roughly: the innovations against signatures of a stone on every place of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from recognition.estimation.arrays import Floats
from recognition.innovations.bank import Bank
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import DURATIONS_S, LEAD, Floats32

SPACING_M = 0.03
LOST = 0.01  # of the energy of the signatures, that the basis leaves out
STARTS, APART_M = 2, 0.04  # places from which a fit starts, and how far they are apart


@dataclass(frozen=True)
class Dictionary:
    """signatures (k, r) of unit length in a basis (FIT_LAGS c, r) that nearly spans them, with their lengths (k,),
    places (k, 2), phases and log durations (k,)."""

    signatures: Floats32
    basis: Floats32
    length: Floats
    place_m: Floats
    phase: Floats
    log_duration: Floats

    @classmethod
    def of(cls, bank: Bank, prior: StonePrior, spacing_m: float = SPACING_M) -> Dictionary:
        """All places, two phases of a sample, and the durations that are to be expected."""
        axes = [np.arange(-h + spacing_m / 2, h, spacing_m) for h in bank.half_m]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        shape = np.array([bank.shape_at(x, y) for x, y in places], dtype=np.float32)
        parts, labels = [], []
        for k in _durations(prior):
            for p in (0, bank.phases // 2):
                parts.append(shape @ bank.fitted[0, k, p + 1])
                labels.append(np.column_stack([places, np.full(len(places), p / bank.phases),
                                               np.full(len(places), np.log(DURATIONS_S[k]))]))
        rows, label = np.vstack(parts), np.vstack(labels)
        length = np.linalg.norm(rows, axis=1)
        unit = rows / length[:, None]
        basis = _basis(unit)
        return cls(unit @ basis, basis, length, label[:, :2], label[:, 2], label[:, 3])

    def starts(self, values: Floats, first: int, candidates: range, needed: float) -> list[Floats]:
        """Up to STARTS stones to start a fit from; none where the greatest gain in the log likelihood is less than
        needed.

        values (c, samples) from sample `first` on; candidates: samples in which the centre of the force may lie.
        """
        c, columns = len(values), len(self.basis)
        flat = np.ascontiguousarray(values.T, dtype=np.float32).ravel()
        begin = (candidates.start - LEAD - first) * c
        spanned = flat[begin:begin + columns + (len(candidates) - 1) * c]
        blocks = np.ascontiguousarray(sliding_window_view(spanned, columns)[::c])
        within = blocks @ self.basis
        if 0.5 * float(np.einsum("kr,kr->k", within, within).max()) < needed:  # more than any signature explains
            return []
        product = within @ self.signatures.T  # (times, k): the greatest of each k is taken of many k at once
        best = product.max(axis=0)
        if 0.5 * float(best.max()) ** 2 < needed:
            return []
        chosen, left = [int(best.argmax())], best.copy()
        while len(chosen) < STARTS:
            left[np.hypot(*(self.place_m - self.place_m[chosen[-1]]).T) <= APART_M] = 0
            k = int(left.argmax())
            if left[k] < 0.9 * best[chosen[0]]:
                break
            chosen.append(k)
        times = [candidates[int(product[:, k].argmax())] + self.phase[k] for k in chosen]
        return [np.array([time, self.log_duration[k], *self.place_m[k], 0.0,
                          np.log(max(best[k], 1e-9) / self.length[k])]) for k, time in zip(chosen, times, strict=True)]


def _basis(unit: Floats32) -> Floats32:
    """(FIT_LAGS c, r): principal directions of unit signatures."""
    power, directions = np.linalg.eigh(unit.T @ unit)
    left_out = int(np.searchsorted(np.cumsum(power), LOST * power.sum()))
    return np.ascontiguousarray(directions[:, left_out:])


def _durations(prior: StonePrior) -> list[int]:
    """Nodes of the table that cover the durations of the prior, about 1.6 apart."""
    logs = prior.means[:, :, 0]
    low, high = (np.interp(v, np.log(DURATIONS_S), np.arange(len(DURATIONS_S))) for v in (logs.min(), logs.max()))
    count = max(1, int(np.ceil((high - low) / 3)))
    return sorted({int(round(low + (high - low) * (k + 0.5) / count)) for k in range(count)})
