"""Where and when something fell, roughly: the innovations against signatures of a stone on every place of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.stream.bank import Bank
from recognition.stream.fit import Found
from recognition.stream.prior import StonePrior
from recognition.stream.signatures import DURATIONS_S, LEAD

SPACING_M = 0.03
STARTS, APART_M = 2, 0.04  # places from which a fit starts, and how far they are apart


@dataclass(frozen=True)
class Dictionary:
    """signatures (k, FIT_LAGS c) of unit length, with their lengths (k,), places (k, 2), phases and log durations
    (k,)."""

    signatures: Floats
    length: Floats
    place_m: Floats
    phase: Floats
    log_duration: Floats

    @classmethod
    def of(cls, bank: Bank, prior: StonePrior, spacing_m: float = SPACING_M) -> Dictionary:
        """All places, two phases of a sample, and the durations that are to be expected."""
        axes = [np.arange(-h + spacing_m / 2, h, spacing_m) for h in bank.half_m]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        shape = np.array([bank.shape_at(x, y)[0] for x, y in places], dtype=np.float32)
        parts, labels = [], []
        for k in _durations(prior):
            for p in (0, bank.phases // 2):
                parts.append(shape @ bank.fitted[0, k, p])
                labels.append(np.column_stack([places, np.full(len(places), p / bank.phases),
                                               np.full(len(places), np.log(DURATIONS_S[k]))]))
        rows, label = np.vstack(parts), np.vstack(labels)
        length = np.linalg.norm(rows, axis=1)
        return cls(rows / length[:, None], length, label[:, :2], label[:, 2], label[:, 3])

    def starts(self, values: Floats, first: int, candidates: range) -> tuple[float, list[Found]]:
        """Greatest gain in the log likelihood, and up to STARTS stones to start a fit from.

        values (c, samples) from sample `first` on; candidates: samples in which the centre of the force may lie.
        """
        c, columns = len(values), self.signatures.shape[1]
        flat = np.ascontiguousarray(values.T).ravel()
        begin = [(k - LEAD - first) * c for k in candidates]
        blocks = np.array([flat[b:b + columns] for b in begin], dtype=np.float32)
        product = blocks @ self.signatures.T
        best_time, best = product.argmax(axis=0), product.max(axis=0)
        chosen: list[int] = []
        for k in np.argsort(-best):
            if all(np.hypot(*(self.place_m[k] - self.place_m[j])) > APART_M for j in chosen):
                chosen.append(int(k))
            if len(chosen) == STARTS or best[k] < 0.5 * best[chosen[0]]:
                break
        found = [Found(0, np.array([candidates[best_time[k]] + self.phase[k], self.log_duration[k], *self.place_m[k],
                                    np.log(max(best[k], 1e-9) / self.length[k])])) for k in chosen]
        return 0.5 * float(best[chosen[0]]) ** 2, found


def _durations(prior: StonePrior) -> list[int]:
    """Nodes of the table that cover the durations of the prior, about 1.3 apart."""
    logs = prior.means[:, :, 0]
    low, high = (np.interp(v, np.log(DURATIONS_S), np.arange(len(DURATIONS_S))) for v in (logs.min(), logs.max()))
    count = max(1, int(np.ceil((high - low) / 2)) + 1)
    return sorted({int(round(v)) for v in np.linspace(low, high, count)})
