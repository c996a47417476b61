"""The lock of a plan: what was registered, orders that follow from it, deviations from it.

Public face: `registration.Registration`, `registration.locked`, `registration.order_problem`,
`deviations.deviations`, `registry_text.registry_text`.
"""
