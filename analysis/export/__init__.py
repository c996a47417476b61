"""A study's data for others: tidy CSV, BIDS and Psych-DS.

Public face: `formats.EXPORTS` and `RECORDINGS`, `dataset.dataset`, `columns.COLUMNS`.
"""
