"""The plate as its sensors know it: its modes, from finite elements and from taps."""
