"""The law of the stones' forces."""
