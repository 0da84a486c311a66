"""Recognition by the physics of the plate."""
