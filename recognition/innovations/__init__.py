"""What a record says beyond the plate's ringing, what a stone looks like in it, and what is known of it beforehand."""
