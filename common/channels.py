"""Names of the signals of a run, which are columns of signals.parquet and fast.parquet.

Each ends in its unit, as `common.units.unit_of` reads it. What a kind of sensor measures is in `dem.record.recorder`.
"""

from __future__ import annotations

from typing import Literal

#: The six responses of the plate that the paper filters and fuses (Section V-B): motion of its centre, and energies.
RESPONSES = ("u_m", "v_m_s", "a_m_s2", "kinetic_J", "internal_J", "total_J")

SensorKind = Literal["acceleration", "velocity", "displacement"]

#: Column of a sensor called NAME by its kind.
SENSORS: dict[SensorKind, str] = {
    "acceleration": "acc_NAME_m_s2", "velocity": "vel_NAME_m_s", "displacement": "disp_NAME_m",
}

#: What the columns of all accelerometers and of all rods begin with.
ACCELEROMETERS, RODS = "acc_", "rod_"


#: Of a plate that stands on rods alone, upwards: the impulse that modal damping took, and the momentum of the rods.
DAMPING_IMPULSE, RODS_MOMENTUM = "damping_impulse_N_s", "rods_momentum_kg_m_s"


def sensor_column(name: str, kind: SensorKind = "acceleration") -> str:
    """Column of a sensor by its name in the scene."""
    return SENSORS[kind].replace("NAME", name)


def rod_column(number: int) -> str:
    """Column of the force in a rod, in N, tension positive; numbers from 1, in the order of the scene."""
    return f"{RODS}{number}_N"


def force_column(number: int) -> str:
    """Column of the force of a stone on the plate, in N; numbers from 1, in the order of the scene."""
    return f"force_{number:02d}_N"
