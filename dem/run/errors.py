"""How a run can end before its end."""

from common.input_error import CommandError
from dem.coupling.exit_code import STOPPED


class RunError(CommandError, RuntimeError):
    """A run that started and could not be finished; one line that says why."""


class Stopped(CommandError, RuntimeError):
    """A run that was asked to stop before its end and did; one line that says how to go on."""

    exit_code = STOPPED
