"""What everybody stands on: scene files, their tables and errors, the run directory's contents, files written whole."""
