"""What every method shares: channels of a record, its window, the answer, the protocol of a method, and its errors."""
