"""The trend by which all frequencies of a real plate differ from those of the plate that it is thought to be.

Another thickness moves all frequencies alike, and another theory of shear moves them the more the higher they are. So
the modes that a fit has found below a frequency tell where those above begin to be sought.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recognition.estimation.arrays import Floats
from recognition.plate.plate_model import PlateModel

LEAST_MODES = 6  # from which a trend is taken


def stretched(plate: PlateModel, thought_Hz: Floats, found_Hz: Floats) -> PlateModel:
    """The plate with its frequencies moved by a trend: the logarithm of a frequency moves by a + b f.

    thought_Hz, found_Hz (k,): frequencies of some of its modes, and what they are found to be. a and b are normally
    distributed about zero; their variance and that of the modes about the trend are those of the greatest evidence
    (MacKay, Bayesian interpolation, Neural Computation 4, 1992). So modes that scatter at random leave the plate nearly
    as it is. With fewer than LEAST_MODES it is left so.
    """
    if thought_Hz.size < LEAST_MODES:
        return plate
    from sklearn.linear_model import BayesianRidge  # late: slow to import

    trend = BayesianRidge(fit_intercept=False).fit(_terms(thought_Hz, plate), np.log(found_Hz / thought_Hz))
    return replace(plate, frequency_Hz=plate.frequency_Hz * np.exp(trend.predict(_terms(plate.frequency_Hz, plate))))


def _terms(frequency_Hz: Floats, plate: PlateModel) -> Floats:
    return np.column_stack([np.ones(frequency_Hz.size), frequency_Hz / plate.max_frequency_Hz])
