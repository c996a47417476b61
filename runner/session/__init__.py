"""The session loop: trials, touches, questions, resuming, and turning the output off at the end.

Public face: `loop.run`, `session.Session`, `trial.touch`, `loop.require_resumable`.
"""
