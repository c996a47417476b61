"""Random drawing of a session's trials: orders, levels, catch trials, blocks and beams.

Public face: `plan.plan`, `trials.Plan`, `trials.Trial`, `feasibility.design_problems`.
"""
