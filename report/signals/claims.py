"""Statements of Section IV: time-frequency parameters of the acceleration."""

from collections.abc import Sequence

import numpy as np

from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import Finding, Statement, Test, all_rise, graded, held_if, held_if_all, spearman


def number_of_imfs_differs(results: SweepResults) -> Finding:
    counts = [len(d.imfs) for d in results.signals.decompositions]
    return held_if(len(set(counts)) > 1), f"{min(counts)} to {max(counts)} IMFs"


def first_imf(results: SweepResults) -> dict[str, np.ndarray]:
    first = [d.imfs[0] for d in results.signals.decompositions]
    return {"up": np.array([imf.max() for imf in first]), "down": np.array([-imf.min() for imf in first])}


def other_imfs_are_irregular(results: SweepResults) -> Finding:
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


RISING = ("square_root_amplitude", "absolute_mean", "variance", "peak_to_peak", "rms", "marginal_spectrum_energy")
FALLING = ("skewness_raw", "margin_index")
DISORDERLY = ("mean", "waveform_index", "kurtosis_index")


def parameters_change(names: Sequence[str], direction: int) -> Test:
    return all_rise(lambda of: {name.replace("_", " "): direction * of.signals.parameters[name] for name in names})


def parameters_are_disorderly(results: SweepResults) -> Finding:
    values = {name.replace("_", " "): results.signals.parameters[name] for name in DISORDERLY}
    values["energy share of IMF 1"] = _energy_share_of_first_imf(results)
    rho = {name: spearman(results.ratios, of_runs) for name, of_runs in values.items()}
    numbers = ", ".join(f"{name} {value:.3f}" for name, value in rho.items())
    return graded(max(map(abs, rho.values())), 0.6, 0.9), f"Spearman {numbers}"


SIGNAL_STATEMENTS = [
    Statement("The number of IMFs differs from ratio to ratio", "Fig. 22", "fig-22", "differs",
              number_of_imfs_differs),
    Statement("The maxima of IMF 1 rise in both directions", "Fig. 22", "fig-22", "Spearman >= 0.9 for both",
              all_rise(first_imf)),
    Statement("The other IMFs show no regular pattern", "Fig. 22", "fig-22", "|Spearman| < 0.9 for each",
              other_imfs_are_irregular),
    Statement("Mean, waveform and kurtosis index and the energy share of IMF 1 change without order", "Fig. 23",
              "fig-23", "|Spearman| < 0.6 for each; partly below 0.9", parameters_are_disorderly),
    Statement("Square root amplitude, absolute mean, variance, peak to peak, RMS and marginal spectrum rise", "Fig. 23",
              "fig-23", "Spearman >= 0.9 for each", parameters_change(RISING, 1)),
    Statement("Skewness and margin index fall with the ratio", "Fig. 23", "fig-23",
              "Spearman <= -0.9 for each (shown with its sign turned)", parameters_change(FALLING, -1)),
    Statement("The RMS of the acceleration grows by 1.764 from 0 to 100 % (implied by Table 2)", "Table 2", "fig-23",
              "1.764 within 5 %; partly within 20 %", rms_grows_as_in_table_2),
]  # fmt: skip
