"""Errors of recognition."""

from common.input_error import InputError


class RecognitionError(InputError):
    """A model cannot be fitted, loaded or applied. The message is one line.

    >>> Fusion("sound").names
    Traceback (most recent call last):
    recognition.estimation.errors.RecognitionError: fusion 'sound'; choose one of energy, other, absolute, composite
    """


class NotRecognised(RecognitionError):
    """A record has no answer under the rules of the method; the message says which rule.

    >>> ratios = np.linspace(0, 1, 5)
    >>> FusionQ().learn(ratios[:, None], ratios).predict(np.array([[[3.0]]]))
    Traceback (most recent call last):
    recognition.estimation.errors.NotRecognised: Q = 3 has no rising root between -0.05 and 1.05 of mixing ratio
    """
