"""How a run can end before its end."""


class RunError(RuntimeError):
    """A run that started and could not be finished; one line that says why."""


class Stopped(RuntimeError):
    """A run that was asked to stop before its end and did; one line that says how to go on."""
