"""Engine and plate side by side: co-step scheme, pipes, checkpoints, watchdog."""
