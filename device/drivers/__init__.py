"""One driver per dialect behind one interface; a new dialect is a new module here.

Public face: `driver.Driver`, `discovery.driver_of`, `discovery.driver_for`, `limits.Setpoint`.
"""
