"""The reduced structure and its solutions: modes, static compliance, stress of a mode."""
