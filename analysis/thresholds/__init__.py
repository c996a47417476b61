"""Thresholds: psychometric functions fitted to answers at known levels.

Public face: `psychometric.fitted`; `answer_table.tracks_in` reads tables of answers.
"""
