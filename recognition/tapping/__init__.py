"""The plate learnt by tapping: its modes from records of taps at known places."""
