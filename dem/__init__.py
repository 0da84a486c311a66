"""Simulation: scenes become decks of LIGGGHTS, which run coupled with the plate."""

from common.late import late

__getattr__, __dir__, __all__ = late(__name__)
