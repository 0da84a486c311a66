"""Stones one by one from a continuous record: arrival, place, material, size, speed, and the mixing ratio."""
