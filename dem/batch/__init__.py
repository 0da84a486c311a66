"""Many runs: sweeps, data sets, campaigns."""
