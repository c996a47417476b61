"""A study's claims under every defensible choice of analysis (Steegen and others, 2016).

Public face: `curve.multiverse`.
"""
