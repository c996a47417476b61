"""The friction coefficient of a scene: laws, rungs of accuracy, contrasts between scenes.

Public face: `coefficient.friction_coefficient`, `changes.predicted_contrast`, `laws.LAWS`,
`rungs.RUNG_NAMES`, `scenes.Scene`.
"""
