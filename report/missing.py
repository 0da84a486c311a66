"""What a part of the report raises when the runs do not give it."""

from analysis import RecordError
from common.input_error import InputError
from recognition.estimation.errors import RecognitionError


class MissingResult(InputError):
    """The runs do not give what a figure, a table or a statement needs; the message is one line that says why."""


#: All errors that leave a figure, a table or a verdict out of the report instead of ending it.
MISSING_RESULT = (MissingResult, RecordError, RecognitionError)
