"""What the pictures of all chapters share; the pictures of a chapter are drawn by its own figures.py."""
