"""The chapter of the plate's response (Figures 16 to 21): numbers, pictures, captions and statements."""
