"""Recognition by the physics of the plate: the likelihood of all arrangements, and the impulse."""
