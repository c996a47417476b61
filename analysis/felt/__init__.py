"""Friction as it was measured at the finger: of each touch, trial and condition."""
