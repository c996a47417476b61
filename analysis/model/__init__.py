"""The friction model in batch: predictions for tables of scenes, and the ladder of rungs.

Public face: `predict.predict`, `ladder.measured_ladder`.
"""
