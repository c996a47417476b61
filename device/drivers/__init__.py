"""One driver per dialect behind one interface; a new dialect is a new module here.

Public face: `driver.Driver`, `registry.driver_of`, `registry.driver_for`, `setpoints.Setpoint`.
"""
