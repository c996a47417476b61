"""Power and precision of a study by simulation: whole cohorts through its own plan and analysis.

A study is simulated (`people_cohorts`), which gives its tables and answers; tests and estimates
make a record of them (`study_records`, `track_records`); all records, and those of `null_cohorts`,
make one `power_summary`, which `power_report` shows.
`job` and `engine` do it in pieces, on many cores.
"""
