"""Statistics of the table of scores: pure functions, exact where the study is small.

Public face: `table4.table4`, `omnibus.friedman`, `signed_rank.signed_rank`,
`summary.table_statistics`.
"""
