"""A study's folder: reading, checking, making and importing it.

Public face: `folder.StudyFolder`, `check.validated_study`, `check.checked`,
`folder.import_scores`, `files.write_whole`, `files.write_files`, `files.write_new_folder`.
"""
