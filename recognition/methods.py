"""The registry of methods: what a model holds, and an evaluation compares."""

from functools import partial

from recognition.estimation.method import MethodEntry, Registry
from recognition.paper.fusion import Fusion
from recognition.paper.q_parameter import FusionQ
from recognition.paper.strategy import FusionPipeline, Rule, Strategy
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.regression.feature_regression import FeatureRegression

METHODS: Registry = {
    "fusion_q": MethodEntry("Q polynomial", FusionQ),
    # As the paper gives it: degree by R^2 >= 0.99, a mean over whatever points are usable.
    "energy_fusion_as_published": MethodEntry("energy fusion as published", lambda: FusionPipeline(
        Fusion("energy"), Strategy(Rule(min_r2=0.99), least_share=0.0, judge="mean"))),
    # Every degree 2, since R^2 > 0.99 lets straight lines through a bent law; every moment counts.
    "energy_fusion_modified": MethodEntry("energy fusion, modified", lambda: FusionPipeline(
        Fusion("energy"), Strategy(Rule(degree=2), least_share=0.5, judge="truncated"))),
    "arrangement_likelihood": MethodEntry("likelihood of arrangements", ArrangementLikelihood, seeks_impact=True,
                                          told=True),
    "energies_sensors": MethodEntry("energies of four accelerometers", partial(FeatureRegression, "energies_sensors")),
}
