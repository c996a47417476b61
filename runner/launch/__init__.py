"""The launch of a session from its options: locks, rig, participant, operator and clock.

Public face: `request.SessionOptions`, `run_session.run_session`, `device_access.session_rig`,
`device_access.stepped_rig`, `locks.rig_lock`.
"""
