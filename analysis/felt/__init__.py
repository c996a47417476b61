"""Sensitivity to friction as it was measured at the finger, beside that to predicted friction."""
