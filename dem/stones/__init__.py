"""Stones: packings of sub-spheres, their bonds and strengths, where they stand."""
