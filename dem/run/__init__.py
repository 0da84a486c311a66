"""One run from scene to run directory."""
