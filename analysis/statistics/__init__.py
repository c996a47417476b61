"""Statistics of the score table as pure functions, exact for small studies.

Public face: `summary.table4`, `omnibus.friedman`, `signed_rank.signed_rank`,
`summary.TableStatistics`.
"""
