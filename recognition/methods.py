"""The registry of methods: what a model holds, and an evaluation compares."""

from __future__ import annotations

from functools import partial

from recognition.estimation.method import MethodEntry, Registry
from recognition.paper.fusion import Fusion
from recognition.paper.pipeline import FusionPipeline, as_published, modified
from recognition.paper.q_parameter import FusionQ
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.regression.feature_regression import FeatureRegression

METHODS: Registry = {
    "fusion_q": MethodEntry("Q polynomial", FusionQ),
    "energy_fusion_as_published": MethodEntry("energy fusion as published",
                                              lambda: FusionPipeline(Fusion("energy"), as_published())),
    "energy_fusion_modified": MethodEntry("energy fusion, modified",
                                          lambda: FusionPipeline(Fusion("energy"), modified())),
    "arrangement_likelihood": MethodEntry("likelihood of arrangements", ArrangementLikelihood, seeks_impact=True,
                                          told=True),
    "energies_sensors": MethodEntry("energies of four accelerometers", partial(FeatureRegression, "energies_sensors")),
}
