"""The section of the report on claims under all choices of analysis, and its figures.

Public face: `specification_curves.section`.
"""
