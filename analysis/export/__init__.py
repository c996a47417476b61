"""A study's data for others: tidy CSV, BIDS and Psych-DS; and for Python: data frames.

Public face: `formats.EXPORTS` and `RECORDINGS`, `dataset.dataset`, `trial_table.Frames`.
"""
