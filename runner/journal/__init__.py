"""The journal file: appending, reading, verifying, backing up and amending a study's events.

Public face: `store.Journal`, `store.SessionLog`, `opening.open_journal`,
`verification.verdicts`, `verification.backed_up`.
"""
