"""The mixing ratio of stones that arrive at once on unknown places."""
