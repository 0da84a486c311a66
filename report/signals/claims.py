"""Statements of Section IV: time-frequency parameters of the acceleration."""

from __future__ import annotations

import numpy as np

from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.trends import spearman
from report.verdicts import (
    Finding,
    Statement,
    Values,
    all_rise,
    graded,
    held_if,
    held_if_all,
    need_enough_ratios,
    trend,
    without_order,
)


def number_of_imfs_differs(results: SweepResults) -> Finding:
    counts = [len(d.imfs) for d in results.signals.decompositions]
    return held_if(len(set(counts)) > 1), f"{min(counts)} to {max(counts)} IMFs"


def first_imf_rises(results: SweepResults) -> Finding:
    need_enough_ratios(results)
    first = [d.imfs[0] for d in results.signals.decompositions]
    up, down = np.array([imf.max() for imf in first]), np.array([-imf.min() for imf in first])
    return all_rise({"up": up, "down": down}, results.ratios)


def other_imfs_are_irregular(results: SweepResults) -> Finding:
    need_enough_ratios(results)
    decompositions = results.signals.decompositions
    common = min(len(d.imfs) for d in decompositions)
    if common < 2:
        raise MissingResult("some run has one IMF only")
    maxima = [np.array([np.abs(d.imfs[k]).max() for d in decompositions]) for k in range(1, common)]
    rho = [abs(spearman(results.ratios, of_imf)) for of_imf in maxima]
    value = f"|Spearman| of the maxima of IMF 2..{common}: {', '.join(f'{r:.2f}' for r in rho)}"
    return held_if_all([r < 0.9 for r in rho]), value


def rms_grows_as_in_table_2(results: SweepResults) -> Finding:
    low, high = results.index_at(0.0), results.index_at(1.0)
    rms = results.signals.parameters["rms"]
    value = rms[high] / rms[low]
    return graded(abs(value / 1.764 - 1), 0.05, 0.2), f"{value:.3f}"


def _energy_share_of_first_imf(results: SweepResults) -> np.ndarray:
    energies = results.signals.imf_energies
    return energies[:, 0] / energies.sum(axis=1)


def _parameter(name: str) -> Values:
    return lambda results: results.signals.parameters[name]


def _rising(name: str, label: str, unit: str = "m/s²") -> Statement:
    return Statement(f"The {label} of the acceleration rises with the ratio as a whole", "Fig. 23", "fig-23",
                     "Spearman >= 0.9", trend(_parameter(name), 1, 1.0, unit))  # fmt: skip


def _falling(name: str, label: str) -> Statement:
    return Statement(f"The {label} of the acceleration falls with the ratio as a whole", "Fig. 23", "fig-23",
                     "Spearman <= -0.9", trend(_parameter(name), -1))  # fmt: skip


def _disorderly(values: Values, label: str) -> Statement:
    return Statement(f"The {label} of the acceleration changes without order", "Fig. 23", "fig-23",
                     "|Spearman| < 0.6; partly below 0.9", without_order(values))  # fmt: skip


SIGNAL_STATEMENTS = [
    Statement("The number of IMFs differs from ratio to ratio", "Fig. 22", "fig-22", "differs",
              number_of_imfs_differs),
    Statement("The maxima of IMF 1 rise in both directions", "Fig. 22", "fig-22", "Spearman >= 0.9 for both",
              first_imf_rises),
    Statement("The other IMFs show no regular pattern", "Fig. 22", "fig-22", "|Spearman| < 0.9 for each",
              other_imfs_are_irregular),
    _disorderly(_energy_share_of_first_imf, "energy share of IMF 1"),
    _disorderly(_parameter("mean"), "mean"),
    _disorderly(_parameter("waveform_index"), "waveform index"),
    _disorderly(_parameter("kurtosis_index"), "kurtosis index"),
    _rising("square_root_amplitude", "square root amplitude"),
    _rising("absolute_mean", "absolute mean"),
    _rising("variance", "variance", "(m/s²)²"),
    _rising("peak_to_peak", "peak-to-peak value"),
    _rising("rms", "RMS"),
    _rising("marginal_spectrum_energy", "energy of the marginal spectrum", "(m/s²)² s"),
    _falling("skewness_raw", "skewness"),
    _falling("margin_index", "margin index"),
    Statement("The RMS of the acceleration grows by 1.764 from 0 to 100 % (implied by Table 2)", "Table 2", "fig-23",
              "1.764 within 5 %; partly within 20 %", rms_grows_as_in_table_2),
]  # fmt: skip
