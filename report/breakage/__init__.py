"""The chapter of breakage (Figures 13 to 15): numbers, pictures, captions and statements."""
