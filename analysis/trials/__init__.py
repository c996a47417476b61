"""Trials against the friction model: predicted contrasts, catch trials, laws compared.

Public face: `contrasts.trial_contrasts`, `trial_statistics.TrialStatistics`,
`law_comparison.law_order`.
"""
