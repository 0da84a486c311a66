"""Recognition of the gangue mixing ratio from the response of the plate (Section V)."""

from recognition.errors import NotRecognised, RecognitionError
from recognition.function_space import FORMS, Rule
from recognition.fusion import FUSIONS, Fusion
from recognition.fusion_q import FusionQ
from recognition.kalman import fuse, kalman_filter
from recognition.models import Model, leave_one_out
from recognition.pipeline import FusionPipeline
from recognition.strategy import JUDGES, Answer, Strategy

__all__ = [
    "FORMS",
    "FUSIONS",
    "JUDGES",
    "Answer",
    "Fusion",
    "FusionPipeline",
    "FusionQ",
    "Model",
    "NotRecognised",
    "RecognitionError",
    "Rule",
    "Strategy",
    "fuse",
    "kalman_filter",
    "leave_one_out",
]
