"""The page of a stream: numbers, pictures and captions."""
