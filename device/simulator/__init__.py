"""A simulated device in a process of its own: the board's language, the beam's physics, faults."""
