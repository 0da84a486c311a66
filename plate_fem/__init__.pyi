from plate_fem.impact import energy_left_out as energy_left_out
from plate_fem.modes import PlateModes as PlateModes, plate_modes as plate_modes
from plate_fem.motion import ModalMotion as ModalMotion, pulse_response as pulse_response
from plate_fem.stress import surface_stress as surface_stress, von_mises as von_mises
