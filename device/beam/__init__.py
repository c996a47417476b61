"""Mechanics of the vibrating beam: modes, driven motion, and what moves under a finger.

Public face: `beam.Beam`, `spectral.natural_frequency_hz`, `driven.driven`, `fields.mode_field`,
`fields.driven_fields`, `pattern.Patterns`, `eq15.Eq15Pattern`.
"""
