"""The contract between runner and analysis: a journal's events and the state they lead to.

Public face: `events.Event`, `events.StoredEvent`, `state.SessionState`, `state.folded`,
`state.next_state`.
"""
