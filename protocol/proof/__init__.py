"""An independent check of plans, which shares no code with the module that draws them.

Public face: `trial_checks.plan_problems`, `trial_checks.cohort_problems`,
`trial_checks.carry_over`, `slide_checks.slide_plan_problems`.
"""
