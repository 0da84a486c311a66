"""Analysis of run directories and of anybody's acceleration record.

Needs neither LIGGGHTS nor a simulation.
"""

from common.late import late

__getattr__, __dir__, __all__ = late(__name__)
