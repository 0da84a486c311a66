"""The chapter of recognition (Figures 24 to 38): numbers, pictures, captions and statements."""
