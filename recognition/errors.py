"""Error of this package."""


class RecognitionError(ValueError):
    """A model cannot be fitted, loaded or applied. The message is one line."""


class NotRecognised(RecognitionError):
    """A record has no answer under the rules of the method; the message says which rule."""
