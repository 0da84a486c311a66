"""The chapter of signal analysis (Figures 22 and 23): numbers, pictures, captions and statements."""
