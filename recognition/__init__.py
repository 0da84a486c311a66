"""Recognition of the gangue mixing ratio from the response of the plate (Section V)."""

from common.late import late

__getattr__, __dir__, __all__ = late(__name__)
