"""Names of the signals of a run, which are columns of signals.parquet and fast.parquet, and their units.

Each name ends in its unit, in scenes, tables and code alike. What a kind of sensor measures: `dem.run.participants`.
"""

import re
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

#: Units by the ending of a name. The longest ending that fits comes first.
UNIT_BY_SUFFIX = {
    "_m_s2": "m/s^2",
    "_kg_m_s": "kg m/s",
    "_N_s": "N s",
    "_kg_m3": "kg/m^3",
    "_m_s": "m/s",
    "_rad_s": "rad/s",
    "_kg_s": "kg/s",
    "_1_s": "1/s",
    "_m2": "m^2",
    "_deg": "deg",
    "_Hz": "Hz",
    "_Pa": "Pa",
    "_m": "m",
    "_s": "s",
    "_N": "N",
    "_J": "J",
}
UNITS = {*UNIT_BY_SUFFIX.values(), "ms", "us", "ns", "min", "h", "g", "kg", "mm", "mm/s", "mm/s^2",
         "kN", "V", "mV", "mA", "%", "-"}


def sensor_column(name: str, kind: SensorKind = "acceleration") -> str:
    """Column of a sensor by its name in the scene."""
    return SENSORS[kind].replace("NAME", name)


def rod_column(number: int) -> str:
    """Column of the force in a rod, in N, tension positive; numbers from 1, in the order of the scene."""
    return f"{RODS}{number}_N"


def force_column(number: int) -> str:
    """Column of the force of a stone on the plate, in N; numbers from 1, in the order of the scene."""
    return f"force_{number:02d}_N"


def plain_unit(text: str) -> str:
    """A unit in the spelling of this project: m/s^2 for [m/s²]."""
    text = re.sub("(?i)sec(onds?|s)?(?![a-z])", "s", text)
    for old, new in (("²", "^2"), ("s2", "s^2"), ("**2", "^2"), ("\u00b5", "u"), ("\u03bc", "u")):
        text = text.replace(old, new)
    return text.strip().strip("[]()").strip()


def name_and_unit(name: str) -> tuple[str, str | None]:
    """("Zeit", "ms") of "Zeit [ms]" or "Zeit (ms)"; None where a name has no unit in brackets. What is no unit of this
    project is taken for one in square brackets only."""
    match = re.fullmatch(r"(.*\S)\s*([\[(])([^\[\]()]+)[\])]", name.strip())
    if match is None or match[2] == "(" and plain_unit(match[3]) not in UNITS:
        return name.strip(), None
    return match[1], plain_unit(match[3])


def unit_of(name: str) -> str:
    """Return the unit of a quantity in brackets behind its name, or by the ending of its name, "1" where it has
    none."""
    by_suffix = (unit for suffix, unit in UNIT_BY_SUFFIX.items() if name.endswith(suffix))
    return name_and_unit(name)[1] or next(by_suffix, "1")
