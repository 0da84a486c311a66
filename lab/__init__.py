"""The laboratory: what proves the product, and is imported by none of it."""
