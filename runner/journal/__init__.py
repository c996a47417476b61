"""The journal file: appending, reading, verifying, backing up and amending a study's events.

Public face: `store.Journal`, `opening.open_journal`, `session_log.SessionLog`,
`verification.verdicts`, `backup.backed_up`.
"""
