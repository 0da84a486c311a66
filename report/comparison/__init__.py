"""Two runs or sweeps side by side."""
