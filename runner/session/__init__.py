"""The session's loop: trials, touches, questions, resuming, and the output off at its end.

Public face: `loop.run`, `session.Session`, `trial.touch`, `resume.require_resumable`.
"""
