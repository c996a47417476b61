"""The fast channel of tangential force, normal force and position: blocks, clocks, recordings.

Public face: `recording.Samples`, `recording.Forces`, `recording.Recorder`, `recording.Block`.
"""
