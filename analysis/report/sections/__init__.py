"""Sections of the report, one module each, with their tables, sentences, figures and data.

Public face: `scores.section`, and `section` of every other module.
"""
