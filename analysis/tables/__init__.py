"""Tables of others: the cells of a file, and what they mean.

Public face: `reading.cells_in`.
"""
