"""The methods that a model holds side by side, by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from recognition.errors import RecognitionError
from recognition.paper.function_space import Rule
from recognition.paper.fusion import Fusion
from recognition.paper.pipeline import FusionPipeline
from recognition.paper.q_parameter import FusionQ
from recognition.paper.strategy import Strategy
from recognition.physics.arrangement_likelihood import Stones
from recognition.regression.band_energies import ENERGY_METHODS, CalibratedEnergies
from recognition.regression.saved_likelihood import CalibratedLikelihood


def printed() -> Strategy:
    """As the paper prints it: degree by R^2 >= 0.99, a mean over whatever points are usable."""
    return Strategy(Rule(min_r2=0.99), least_share=0.0, judge="mean")


def mended() -> Strategy:
    """Every degree 2, since R^2 > 0.99 lets straight lines through a bent law; every moment counts."""
    return Strategy(Rule(degree=2), least_share=0.5, judge="truncated")


#: name -> an unfitted method of the paper.
PAPER_METHODS: dict[str, Callable[[], FusionQ | FusionPipeline]] = {
    "fusion_q": FusionQ,
    "energy_fusion_printed": lambda: FusionPipeline(Fusion("energy"), printed()),
    "energy_fusion_mended": lambda: FusionPipeline(Fusion("energy"), mended()),
}

#: One likelihood over all moments.
LIKELIHOODS: dict[str, Callable[[], CalibratedLikelihood]] = {
    f"likelihood_{kind}": partial(CalibratedLikelihood, kind) for kind in ("accelerometers", "centre")
}

#: Those that give an interval and a warning, the best by evaluation first.
CALIBRATED: dict[str, Callable[[], Stones | CalibratedEnergies | CalibratedLikelihood]] = {
    "stones": Stones, **ENERGY_METHODS, **LIKELIHOODS}

#: name -> an unfitted method of a saved model.
METHODS: dict[str, Callable[[], FusionQ | FusionPipeline | Stones | CalibratedEnergies | CalibratedLikelihood]] = {
    **PAPER_METHODS, **CALIBRATED}

#: As a reader sees them.
METHOD_NAMES = {
    "fusion_q": "Q polynomial",
    "energy_fusion_printed": "energy fusion as printed",
    "energy_fusion_mended": "energy fusion, mended",
    "stones": "which stones are gangue",
    "impulse": "impulse from plate and rods",
    "energies_all": "energies of all signals",
    "energies_sensors": "energies of four accelerometers",
    "energies_rms": "RMS of four accelerometers",
    "likelihood_accelerometers": "likelihood of four accelerometers",
    "likelihood_centre": "likelihood of the centre of mass",
}

#: Further ones of the evaluation.
EVALUATED_NAMES = METHOD_NAMES | {
    "stones_fast": "which stones are gangue, at 40 kHz",
    "rms_line": "RMS and a straight line",
    "ridge_accelerometers": "ridge, four accelerometers",
    "likelihood_rods": "likelihood of the rods",
    "likelihood_all": "likelihood of all signals",
}


def load_method(name: str, data: dict):
    """A fitted method from its part of a saved model."""
    if name not in METHODS:
        raise RecognitionError(f"method {name!r}; this program has {', '.join(METHODS)}")
    if name == "stones":
        return Stones.from_dict(data)
    if name in ENERGY_METHODS:
        return CalibratedEnergies.from_dict(data)
    if name in LIKELIHOODS:
        return CalibratedLikelihood.from_dict(data)
    return (FusionQ if name == "fusion_q" else FusionPipeline).from_dict(data)
