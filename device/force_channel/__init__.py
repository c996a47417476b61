"""The fast channel of tangential force, normal force and position: blocks, clocks, recordings.

Public face: `samples.Samples`, `samples.Forces`, `recorder.Recorder`, `blocks.Block`.
"""
