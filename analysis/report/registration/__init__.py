"""The report of a registered study: what was registered, how it came out, and what deviates.

Public face: `registered.analysis_settings`, `registered.section`, `registered.marked`.
"""
