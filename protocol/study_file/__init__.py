"""From the text of a study file to a checked study, or to every problem with its line.

Public face: `loading.parsed_study`, `loading.StudyError`, `loading.template`, `limits.problems_at`.
"""
