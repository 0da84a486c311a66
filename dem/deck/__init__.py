"""The deck: time step, contact laws and the rendered LIGGGHTS input."""
