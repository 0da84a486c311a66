"""Units by the ending of a name, the same in scenes, tables and code."""

#: The longest ending that fits comes first.
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


def unit_of(name: str) -> str:
    """Return the unit of a quantity by the ending of its name, "1" where it has none."""
    for suffix, unit in UNIT_BY_SUFFIX.items():
        if name.endswith(suffix):
            return unit
    return "1"
