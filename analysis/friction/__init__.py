"""Friction as it was measured at the finger: recordings of touches, and what changed in a trial.

Nothing here reads a journal or knows a study: `analysis.loading` reduces recordings as it reads
them, and `analysis.felt` tells what each trial compared.
"""
