"""Recognition of the gangue mixing ratio from the response of the plate (Section V)."""

from typing import TYPE_CHECKING

from common.late import late

if TYPE_CHECKING:
    from recognition.estimation.answer import Answer
    from recognition.estimation.errors import NotRecognised, RecognitionError
    from recognition.models import Model, leave_one_out
    from recognition.paper.function_space import FORMS, Rule
    from recognition.paper.fusion import FUSIONS, Fusion
    from recognition.paper.kalman import fuse, kalman_filter
    from recognition.paper.pipeline import FusionPipeline
    from recognition.paper.q_parameter import FusionQ
    from recognition.paper.strategy import JUDGES, Strategy

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

__getattr__ = late(__name__, {
    "Answer": "recognition.estimation.answer",
    "NotRecognised": "recognition.estimation.errors", "RecognitionError": "recognition.estimation.errors",
    "Model": "recognition.models", "leave_one_out": "recognition.models",
    "FORMS": "recognition.paper.function_space", "Rule": "recognition.paper.function_space",
    "FUSIONS": "recognition.paper.fusion", "Fusion": "recognition.paper.fusion",
    "fuse": "recognition.paper.kalman", "kalman_filter": "recognition.paper.kalman",
    "FusionPipeline": "recognition.paper.pipeline",
    "FusionQ": "recognition.paper.q_parameter",
    "JUDGES": "recognition.paper.strategy", "Strategy": "recognition.paper.strategy",
})  # fmt: skip
