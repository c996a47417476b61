"""From options to a running session: who takes part, on which rig, at which pace.

Public face: `run_session.Sitting`, `run_session.sit`, `rig.rigged`, `locks.rig_held`.
"""
