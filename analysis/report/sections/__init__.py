"""Sections of the report, each with its tables, sentences, figures and data.

Public face: `scores.section`, and `section` of every other module, but `effects.tests` and
`effects.agreement`; `model_checks` has two more, `model_checks.predictive` and
`model_checks.recovery`. Of a registered study, also `registration.registered_lines` and
`registration.analysis_settings`.
"""
