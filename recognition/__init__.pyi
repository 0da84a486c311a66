from recognition.estimation.answer import Answer as Answer
from recognition.estimation.errors import NotRecognised as NotRecognised, RecognitionError as RecognitionError
from recognition.models import Model as Model
from recognition.paper.fusion import FUSIONS as FUSIONS, Fusion as Fusion, fuse as fuse, kalman_filter as kalman_filter
from recognition.paper.q_parameter import FusionQ as FusionQ
from recognition.paper.strategy import (
    JUDGES as JUDGES,
    FusionPipeline as FusionPipeline,
    Rule as Rule,
    Strategy as Strategy,
)
from recognition.plate.plate_model import PlateModel as PlateModel
from recognition.regression.feature_regression import FeatureRegression as FeatureRegression
