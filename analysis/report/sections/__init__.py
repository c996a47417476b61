"""The sections of the report, a module each: its tables, sentences, figures and data.

Public face: `scores.section`, and `section` of every other module.
"""
