"""The chapter of theory (Figures 7 to 11): numbers, pictures, captions and statements."""
