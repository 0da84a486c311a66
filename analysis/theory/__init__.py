"""Elastic impact on a plate, in theory."""
