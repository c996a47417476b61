"""The lock of a plan: what was registered, the seed that follows from it, deviations from it.

Public face: `registration.Registration`, `registration.locked`, `deviations.deviations`,
`registry_text.registry_text`.
"""
