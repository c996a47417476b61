"""The participant's window: a separate process that displays a session's screens.

Public face: `client.WindowParticipant`, `client.participant_window`, `server.serve_window`,
`preflight.study_window`.
"""
