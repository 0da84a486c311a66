"""What a record says beyond the plate's ringing, and what a stone looks like in it."""
