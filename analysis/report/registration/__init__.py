"""The report of a registered study: what was registered, how it came out, and what deviates.

Public face: `analysis_settings.analysis_settings`, `registered.section`, `named_results.marked`.
"""
