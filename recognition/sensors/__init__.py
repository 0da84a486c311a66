"""Sensors as they are: offset, hum, clipping, dead and swapped channels, gains."""
