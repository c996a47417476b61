"""Trials against the friction model: predicted contrasts, catch trials, laws compared.

Public face: `contrasts.trial_contrasts`, `trial_statistics.trial_statistics`,
`law_order.law_order`.
"""
