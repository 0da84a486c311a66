"""Errors of recognition."""

from analysis.records import one_line


class RecognitionError(ValueError):
    """A model cannot be fitted, loaded or applied. The message is one line."""

    def __init__(self, message: str):
        super().__init__(one_line(message))


class NotRecognised(RecognitionError):
    """A record has no answer under the rules of the method; the message says which rule."""
