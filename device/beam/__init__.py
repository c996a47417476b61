"""Mechanics of the vibrating beam: mode shapes, zones, motion and the finger's window.

Public face: `beam.Beam`, `modes.mode_shape`, `zones.zones`, `windows.mode_window`,
`motion.segmented_motion`.
"""
