"""From options to a running session: who takes part, on which rig, at which pace.

Public face: `run_session.SessionOptions`, `run_session.run_session`, `rig.session_rig`,
`locks.rig_lock`.
"""
