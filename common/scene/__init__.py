"""The scene file: what falls on what, table by table."""
