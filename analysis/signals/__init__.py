"""Records and what is computed of them: decomposition, spectra, features."""
