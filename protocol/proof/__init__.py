"""An independent check of plans, which uses nothing of the code that drew them.

Public face: `trial_checks.plan_problems`, `cohort.cohort_problems`, `cohort.carry_over`.
"""
