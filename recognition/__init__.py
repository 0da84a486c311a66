"""Recognition of the gangue mixing ratio from the response of the plate (Section V)."""

from recognition.errors import NotRecognised, RecognitionError
from recognition.fusion import FUSIONS, Fusion
from recognition.fusion_q import FusionQ
from recognition.kalman import fuse, kalman_filter
from recognition.models import Model, leave_one_out
from recognition.strategy import Answer, Strategy

__all__ = [
    "FUSIONS",
    "Answer",
    "Fusion",
    "FusionQ",
    "Model",
    "NotRecognised",
    "RecognitionError",
    "Strategy",
    "fuse",
    "kalman_filter",
    "leave_one_out",
]
