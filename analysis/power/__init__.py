"""Power and precision of a study by simulation: whole cohorts through its own plan and analysis.

A study is simulated (`people_cohorts`), which gives its tables; tests and estimates make a record
of them (`records`, `track_records`); all records make one `summary`, which `power_report` shows.
`job` and `engine` do it in pieces, on many cores.
"""
