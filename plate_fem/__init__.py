"""Modes of a plate on rods by finite elements, their exact motion, and stress."""

from common.late import late

__getattr__, __dir__, __all__ = late(__name__)
