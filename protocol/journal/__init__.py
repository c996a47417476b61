"""The contract between runner and analysis: what a journal holds and how it adds up.

Public face: `events.Event`, `events.StoredEvent`, `state.SessionState`, `state.folded`,
`transitions.next_state`.
"""
