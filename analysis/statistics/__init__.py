"""Statistics of the table of scores: pure functions, exact where the study is small."""
