"""Tables of others: the cells of a file, what their columns mean, and the study of the scores.

Public face: `reading.cells_in`, `score_table.scores_in`, `imported_study.described`.
"""
