"""What a command tells of a run that ended: a line of what it found, or of why it failed, and an exit code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from common.command import say
from common.output_directory import Busy
from common.tables import InputError
from dem.coupling.exit_code import STOPPED
from dem.coupling.messages import CouplingError
from dem.run.errors import RunError, Stopped


def one_line(summary: dict[str, Any]) -> str:
    """A finished run in one line."""
    return (f"{summary['scene']['name']} {summary['gangue_ratio']:4.0%}: peak force {summary['peak_force_N']:9.1f} N, "
            f"{summary['n_bonds_broken']} of {summary['n_bonds']} bonds broken, "
            f"energy closes to {summary['energy']['closure']:.1e}, "
            f"{sum(summary['wall_time_s'].values()):.0f} s")


def exit_code_of(command: Callable[[], int]) -> int:
    """What a command returns; or, with one line on standard error, 2 for bad input, 75 for a run that was stopped, 1
    for one that failed."""
    try:
        return command()
    except InputError as error:
        say(str(error))
        return 2
    except Stopped as stopped:
        say(str(stopped))
        return STOPPED
    except (RunError, CouplingError, Busy) as error:
        say(str(error))
        return 1
