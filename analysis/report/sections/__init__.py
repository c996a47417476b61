"""Sections of the report, each with its tables, sentences, figures and data.

Public face: `scores.section`, and `section` of every other module; `model_checks` has two,
`model_checks.predictive` and `model_checks.recovery`.
"""
