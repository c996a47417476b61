"""Power and precision of a study by simulation: whole cohorts through its own plan and analysis.

Public face: `job.Design`, `job.Job`, `engine.completed`, `diagnosands.Findings`,
`power_report.power_record`.
"""
