"""A study's folder: reading, checking, making and importing it.

Public face: `folder.StudyFolder`, `check.usable`, `check.checked`, `published.import_table`.
"""
