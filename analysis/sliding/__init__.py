"""The sliding experiment (paper, section 5.1): friction along the beam, and the rig fitted to it.

Public face: `rig_model.Pass`, `experiment.sliding_findings`, `comparison.figure_panels`.
"""
