"""Recognition of the gangue mixing ratio from the response of the plate (Section V)."""

import sys

from common.command import listen_for_interrupt

if sys.argv[:1] == ["-m"]:  # `python -m recognition` comes here first, and the imports below take their time
    listen_for_interrupt()


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
