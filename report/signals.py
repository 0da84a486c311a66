"""The chapter of signal analysis (Figures 22 and 23): numbers, pictures, captions and statements."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from analysis.signals.emd import Decomposition, decompose
from analysis.signals.features import time_features
from analysis.signals.hilbert import hilbert_spectrum, marginal_spectrum
from report.drawing.figure_spec import Drawn, figure
from report.drawing.lines import against_ratio
from report.drawing.style import bar_axes, canvas, ratio_colours
from report.missing import MissingResult
from report.sweep_results import SweepResults
from report.verdicts import Finding, Statement, Test, all_rise, graded, held_if, held_if_all, listed, spearman

MOST_IMFS = 5
PARAMETER_LABELS = {
    "square_root_amplitude": "square root amplitude, m/s²",
    "absolute_mean": "absolute mean, m/s²",
    "mean": "mean, m/s²",
    "variance": "variance, (m/s²)²",
    "peak_to_peak": "peak to peak, m/s²",
    "rms": "RMS, m/s²",
    "waveform_index": "waveform index",
    "kurtosis_index": "kurtosis index",
    "skewness_raw": "skewness (raw), (m/s²)³",
    "margin_index": "margin index",
    "marginal_spectrum_energy": "marginal spectrum, (m/s²)² s",
}
RISING = ("square_root_amplitude", "absolute_mean", "variance", "peak_to_peak", "rms", "marginal_spectrum_energy")
FALLING = ("skewness_raw", "margin_index")
DISORDERLY = ("mean", "waveform_index", "kurtosis_index")


class Signals:
    """Parameters of each run's acceleration in the paper's window."""

    def __init__(self, results: SweepResults):
        self._runs = results.runs

    @cached_property
    def decompositions(self) -> list[Decomposition]:
        """Intrinsic mode functions (IMFs) of each run. Raises MissingResult where a record is too short to have one."""
        found = [decompose(run.record("a_m_s2")) for run in self._runs]
        if not all(len(d.imfs) for d in found):
            raise MissingResult(f"records of {self._runs[0].t_s.size} samples are too short for an IMF")
        return found

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """Parameters of Figure 23 but the energies of the IMFs, shape (runs,) each."""
        rows = [{f.name: f.value for f in time_features(run.record("a_m_s2"))} for run in self._runs]
        table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        energy = [marginal_spectrum(d, kind="energy").total for d in self.decompositions]
        return table | {"marginal_spectrum_energy": np.array(energy)}

    @cached_property
    def imf_energies(self) -> np.ndarray:
        """Energies of the IMFs in (m/s^2)^2 s, shape (runs, most IMFs); 0 where a run has fewer IMFs."""
        most = max(len(d.imfs) for d in self.decompositions)
        return np.stack([np.pad(d.energies, (0, most - len(d.imfs))) for d in self.decompositions])


@figure("fig-22", "IMFs of the acceleration", "Ten siftings an IMF.")
def imfs(results: SweepResults) -> Drawn:
    shown = sorted({0, len(results.runs) - 1})
    found = {float(results.ratios[i]): results.of(Signals).decompositions[i].imfs for i in shown}
    rows = min(MOST_IMFS, max(len(imf) for imf in found.values()))
    figure, axes = canvas(rows, height_in=1.0 * rows + 0.5, sharex=True)
    for k, axis in enumerate(axes[:, 0]):
        axis.set_title(f"IMF {k + 1}, m/s²")
        for (ratio, of_run), colour in zip(found.items(), ratio_colours(found), strict=True):
            if k < len(of_run):
                axis.plot(1e3 * results.t_s, of_run[k], color=colour, linewidth=0.8, label=f"{100 * ratio:.0f} %")
    if len(found) > 1:
        axes[0, 0].legend(ncols=2, loc="upper right")
    axes[-1, 0].set_xlabel("time, ms")
    return figure, "Lowest and highest ratio." if len(shown) > 1 else ""


@figure("fig-hilbert", "Hilbert and marginal spectrum", "Marginal spectrum in bins of 25 Hz.")
def hilbert(results: SweepResults) -> Drawn:
    decompositions = results.of(Signals).decompositions
    spectrum = hilbert_spectrum(decompositions[-1], bin_width_Hz=50.0, times=134)
    marginal = {r: marginal_spectrum(d) for r, d in zip(results.ratios, decompositions, strict=True)}
    figure, axes = canvas(2, height_in=4.6, bar="right")
    upper, lower = axes[:, 0]
    field = np.ma.masked_equal(spectrum.amplitude, 0)
    image = upper.pcolormesh(1e3 * spectrum.edges_s, 1e-3 * spectrum.edges_Hz, field, cmap="viridis", rasterized=True)
    figure.colorbar(image, cax=bar_axes(figure), label="amplitude in the map, m/s²")
    upper.set(title="frequency, kHz", xlabel="time, ms")
    upper.grid(False)
    for (ratio, found), colour in zip(marginal.items(), ratio_colours(marginal), strict=True):
        lower.plot(1e-3 * found.centres_Hz, found.density, color=colour, linewidth=0.8, label=f"_{100 * ratio:.0f} %")
    lower.set(title="marginal spectrum, m/s² s/Hz", xlabel="frequency, kHz")
    return figure, "Above: highest ratio; below: each ratio." if len(marginal) > 1 else ""


@figure("fig-23", "Time-frequency parameters", "Of the acceleration of the plate's centre of mass.", ratios=2)
def parameters(results: SweepResults) -> Drawn:
    energies = results.of(Signals).imf_energies[:, :3].T
    panels = [("energy of IMF 1-3, (m/s²)² s", {f"IMF {k}": row for k, row in enumerate(energies, 1)})]
    panels += [(label, {label: results.of(Signals).parameters[name]}) for name, label in PARAMETER_LABELS.items()]
    return against_ratio(results.ratios, panels)


SIGNAL_FIGURES = [imfs, hilbert, parameters]


def number_of_imfs_differs(results: SweepResults) -> Finding:
    counts = [len(d.imfs) for d in results.of(Signals).decompositions]
    return held_if(len(set(counts)) > 1), f"{min(counts)} to {max(counts)} IMFs"


def first_imf(results: SweepResults) -> dict[str, np.ndarray]:
    first = [d.imfs[0] for d in results.of(Signals).decompositions]
    return {"up": np.array([imf.max() for imf in first]), "down": np.array([-imf.min() for imf in first])}


def other_imfs_are_irregular(results: SweepResults) -> Finding:
    decompositions = results.of(Signals).decompositions
    common = min(len(d.imfs) for d in decompositions)
    if common < 2:
        raise MissingResult("some run has one IMF only")
    maxima = [np.array([np.abs(d.imfs[k]).max() for d in decompositions]) for k in range(1, common)]
    rho = [abs(spearman(results.ratios, of_imf)) for of_imf in maxima]
    value = f"|Spearman| of the maxima of IMF 2..{common}: {', '.join(f'{r:.2f}' for r in rho)}"
    return held_if_all([r < 0.9 for r in rho]), value


def rms_grows_as_in_table_2(results: SweepResults) -> Finding:
    low, high = results.index_at(0.0), results.index_at(1.0)
    rms = results.of(Signals).parameters["rms"]
    value = rms[high] / rms[low]
    return graded(abs(value / 1.764 - 1), 0.05, 0.2), f"{value:.3f}"


def parameters_change(names: Sequence[str], direction: int) -> Test:
    return all_rise(lambda of: {name.replace("_", " "): direction * of.of(Signals).parameters[name] for name in names})


def parameters_are_disorderly(results: SweepResults) -> Finding:
    found, energies = results.of(Signals).parameters, results.of(Signals).imf_energies
    values = {name.replace("_", " "): found[name] for name in DISORDERLY}
    values["energy share of IMF 1"] = energies[:, 0] / energies.sum(axis=1)
    rho = {name: spearman(results.ratios, of_runs) for name, of_runs in values.items()}
    return graded(max(map(abs, rho.values())), 0.6, 0.9), f"Spearman {listed(rho, '.3f')}"


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
