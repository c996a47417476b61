"""The participant's window: a process of its own that a session sends screens to and polls.

Public face: `client.WindowParticipant`, `client.participant_window`, `server.serve_window`,
`preflight.study_window`.
"""
