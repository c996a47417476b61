"""One driver per dialect behind one interface; a new dialect is a new module here.

Public face: `driver.Driver`, `driver.driver_of`, `driver.driver_for`, `limits.Setpoint`.
"""
