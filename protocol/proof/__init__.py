"""An independent check of plans, which shares no code with the module that draws them.

Public face: `trial_checks.plan_problems`, `cohort.cohort_problems`, `cohort.carry_over`,
`slide_checks.slide_plan_problems`.
"""
