"""Virtual laboratory tests, and bonds fitted to them."""
