"""Participants and operators, at a terminal or virtual.

Public face: `participant_console.ConsoleParticipant`, `virtual_participant.VirtualParticipant`,
`virtual_participant.VirtualAtWindow`, `operator_console.OperatorConsole`.
"""
