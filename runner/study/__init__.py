"""A study's folder: reading, checking, making and importing it.

Public face: `folder.StudyFolder`, `check.validated_study`, `check.checked`,
`published.import_table`.
"""
