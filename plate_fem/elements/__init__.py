"""Finite elements: plate, rods, mesh, stiffness and mass."""
