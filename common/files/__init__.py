"""Files and directories that a command writes and reads."""
