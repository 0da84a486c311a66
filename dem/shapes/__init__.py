"""Shapes of stones: polyhedra and meshes."""
